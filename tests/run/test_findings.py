from rotcli.run.findings import Finding, texts


def test_a_finding_becomes_a_json_object_with_its_number_limit_and_unit():
    finding = Finding(
        "clock-rate", "imu.csv: 5 ppm", where="imu.csv", value=5.0, limit=1.0, unit="ppm"
    )
    assert finding.to_dict() == {
        "code": "clock-rate",
        "severity": "warning",
        "where": "imu.csv",
        "value": 5.0,
        "limit": 1.0,
        "unit": "ppm",
        "text": "imu.csv: 5 ppm",
    }


def test_notes_are_not_among_the_texts_and_equal_texts_appear_once():
    found = [Finding("a", "one", "note"), Finding("b", "two"), Finding("c", "two", "error")]
    assert texts(found) == ["two"]
