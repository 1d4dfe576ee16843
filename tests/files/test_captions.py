import pytest

from rotcli.files import captions


def rig(**table):
    return {"rig": {"imu": {"name": "NAV440"}, "table": table}}


@pytest.mark.parametrize(
    ("doc", "words"),
    [
        ({**rig(axis="z"), "rate": {"value": 10.00000000000014}}, "about z at 10 deg/s"),
        (
            {**rig(axis=[0.6, 0.0, 0.8]), "rate": {"value": -5.5}},
            "about (0.6, 0, 0.8) at -5.5 deg/s",
        ),
        ({**rig(axis="x"), "rate": {"value": 2e-9}}, "still"),
        ({**rig(axis="x"), "rate": {"value": 5.0}, "axis": "none"}, "still"),
        (rig(axis="z"), "about z"),
    ],
)
def test_the_motion_is_described_in_words(doc, words):
    assert captions.motion(doc) == words


def test_a_mean_rate_is_not_shown_as_the_rate():
    doc = {**rig(axis="y"), "rate": {"value": 0.0}}
    assert captions.motion(doc, constant_rate=False) == "about y at varying rates"


def test_an_imu_without_a_name_is_described_as_such_or_omitted():
    assert captions.subject({}, "full") == "unnamed IMU, full"
    assert captions.title_without_imu({}, "error budget", "still") == "Error budget, still"
    assert captions.title_without_imu(rig(), "error budget") == "NAV440, error budget"


def test_the_end_of_a_long_path_is_kept_and_the_window_of_a_filter_found():
    path = "/campaign/" + 20 * "a_long_folder/" + "imu.parquet"
    shown = captions.log({"inputs": [{"path": path}]})
    assert len(shown) == 48
    assert shown.startswith("…")
    assert shown.endswith("a_long_folder/imu.parquet")
    window = {"start_s": 3.0, "end_s": 1.7e9}
    for fields in ({"window": window}, {"filter": {"window": window}}, {"filter": window}):
        assert captions.log({"inputs": [{"path": "a.csv"}], **fields}) == "a.csv, 3 to 1700000000 s"
    assert captions.log({"inputs": [{"path": "a.csv"}], "filter": {"nis": 3.0}}) == "a.csv"
