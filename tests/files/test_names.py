from rotcli.files.names import nearest


def test_the_nearest_name_is_found_however_it_is_written():
    known = ["calibrate", "navigate", "report"]
    assert nearest("NAVIGAT", known) == "navigate"
    assert nearest("zzz", known) in known


def test_a_name_without_end_among_names_without_number_is_soon_told():
    assert nearest("navigate" * 100_000, (str(n) for n in range(10_000_000))) is not None
