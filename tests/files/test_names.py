from rotcli.files.names import closest_match, suggest


def test_the_similar_name_is_found_in_any_case():
    known = ["calibrate", "navigate", "report"]
    assert closest_match("NAVIGAT", known) == "navigate"
    assert suggest("NAVIGAT", known) == "similar: navigate"


def test_no_name_is_suggested_where_none_is_similar():
    known = ["calibrate", "navigate", "report"]
    assert closest_match("zzz", known) is None
    assert suggest("zzz", known) == "known: calibrate, navigate, report"


def test_a_name_without_end_among_names_without_number_is_soon_compared():
    assert closest_match("navigate" * 100_000, (str(n) for n in range(10_000_000))) is None
