"""The published values of R16 (Sensors 2016, 16, 2017), read against the paper's tables."""

import math

import pytest

from rotcli.files.published import published, set_up

FIGURES = (
    "latitude_m",
    "longitude_m",
    "height_m",
    "v_north_mps",
    "v_east_mps",
    "v_up_mps",
    "pitch_deg",
    "roll_deg",
    "azimuth_deg",
)


@pytest.mark.parametrize(
    ("imu", "printed"),
    [
        ("MTi-G", (2412.3, 1526.8, 173.8, 33.2, 20.5, 1.2, 1.83, 1.32, 2.31)),  # table 4
        ("NAV440", (829.1, 2820.1, 1033.0, 4.8, 26.7, 9.0, 0.48, 0.60, 0.73)),  # table 5
    ],
)
def test_conventional_rms_is_that_of_tables_4_and_5(imu, printed):
    values = published(imu).rms["conventional"]
    assert tuple(values[name] for name in FIGURES) == printed


def test_campaign_means_are_those_of_section_4_2():
    for imu, mode, metres, speed in (
        ("MTi-G", "partial", 1525.8, 14.6),
        ("MTi-G", "full", 1057.2, 10.4),
        ("NAV440", "partial", 544.8, 4.9),
        ("NAV440", "full", 213.8, 2.2),
    ):
        assert published(imu).rms[mode] == {"horizontal_m": metres, "horizontal_mps": speed}


def test_conventional_horizontal_is_the_root_sum_of_squares():
    # 2855 m, 39.0 m/s and 2939 m, 27.1 m/s: rounded to their last digit.
    for imu, metres, speed in (("MTi-G", 2855, 39.0), ("NAV440", 2939, 27.1)):
        values = published(imu).rms["conventional"]
        assert values["horizontal_m"] == pytest.approx(metres, abs=0.5)
        assert values["horizontal_mps"] == pytest.approx(speed, abs=0.05)


@pytest.mark.parametrize(
    ("imu", "bias", "scale", "walk"),
    [
        ("MTi-G", 23.2, (645.5, 322.7, 215.2, 161.4, 129.1, 107.6, 92.2, 80.7), 3.0),
        ("NAV440", 3.1, (86.1, 43.0, 28.7, 21.5, 17.2, 14.2, 12.3, 10.8), 0.4),
    ],
)
def test_noise_errors_are_those_of_table_6_and_follow_from_the_formulas(imu, bias, scale, walk):
    values = published(imu)
    assert values.bias_dph == bias
    assert tuple(values.scale_ppm) == tuple(range(10, 81, 10))
    assert tuple(values.scale_ppm.values()) == scale
    # R16 (35), (36) with 60 s still and 60 s turning; the paper rounds 14.3 twice, to 14.2.
    assert bias == pytest.approx(walk * 60 / math.sqrt(60), abs=0.05)
    for rate, ppm in values.scale_ppm.items():
        assert ppm == pytest.approx(walk / 60 * math.sqrt(60) / (60 * rate) * 1e6, abs=0.16)


def test_bounds_are_those_of_table_7():
    limits = set_up()
    assert (limits.across_dps, limits.along_dps) == (0.011, 0.025)
    assert (limits.axis, limits.duration_s, limits.rates) == ("z", 300.0, 10)


def test_an_imu_is_found_whatever_the_spelling_and_a_stranger_is_not():
    assert published("nav 440") == published("NAV440")
    assert published("MTi-G-710") is None
