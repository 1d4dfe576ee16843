from rotcli.report.kinds import KINDS
from rotcli.report.report import gather
from rotcli.report.sentences import (
    allan_sentences,
    observability_headline,
    srins_observability_headline,
    srins_sentences,
)

FILTERED = {
    "axis": "y", "rate": {"value": 10.0}, "rank": 11, "weak": False, "advice": "Tilt the axis.",
    "filter": {
        "rms": {"roll_deg": 0.1234, "pitch_deg": 0.0456, "azimuth_deg": 2.0},
        "duration_s": 300.0,
        "not_to_be_used": {"azimuth": "unobservable"},
        "estimates": {"accel_bias_x": {}, "azimuth": {}},
        "consistency": {"verdict": "consistent"},
    },
}  # fmt: skip


def test_the_noise_of_an_imu_is_the_range_over_its_axes(documents):
    doc = documents.allan("B")
    doc["axes"]["gyro_z"]["coefficients"]["random_walk"]["value"] = 0.3
    (text,) = allan_sentences(documents.sources(doc))
    assert text.startswith("B: noise: gyros angle random walk 0.25 to 0.3 deg/sqrt(h)")


def test_a_filtered_motion_says_rank_errors_and_which_estimates_are_reliable():
    text = observability_headline(FILTERED)
    assert text == (
        "about y at 10 deg/s: 11 of 12 states observable; RMS attitude errors roll 0.12, pitch "
        "0.046, azimuth 2 deg over 300 s; reliable: accel bias x; sigmas consistent."
    )
    analysed = {key: value for key, value in FILTERED.items() if key != "filter"}
    assert observability_headline({**analysed, "weak": True}) == (
        "about y at 10 deg/s: 11 of 12 states observable, weakly. Tilt the axis."
    )


def test_a_voyage_says_drift_error_in_sigma_and_convergence(documents):
    doc = {
        "mode": "damped",
        "estimates": {"gyro_bias_z": {"value": 0.00305, "sigma": 0.00033}},
        "truth": {"gyro_bias_z": 0.003},
        "filter": {"start_s": 0.0, "end_s": 36000.0},
        "convergence": {"stated_drift_dph": 0.003, "fractions": [0.33, 0.22, 0.1],
                        "hours": [4.0, 5.96, None]},
        "consistency": {"gnss": {"sound": True}},
    }  # fmt: skip
    (text,) = srins_sentences(documents.sources(doc))
    assert text.endswith(
        "(damped): drift along the axis 0.00305 deg/h after 10 h, sigma 0.00033, error 0.2 sigma; "
        "sigma below 22 % of 0.003 deg/h after 5.96 h; GNSS innovations consistent."
    )


def test_schemes_are_compared_by_the_drift_along_the_axis():
    doc = {"true_rank": 13, "states": ["a"] * 16, "hours": 10.0,
           "degrees": {"still": {"gyro_bias_z": 0.9}, "two-stop": {"gyro_bias_z": 0.95}},
           }  # fmt: skip
    assert srins_observability_headline(doc) == (
        "true rank 13 of 16; degree of observability of the drift along the axis after 10 h: "
        "still 0.900, two-stop 0.950."
    )


def test_every_kind_of_result_opens_with_a_summary(documents, tmp_path):
    docs = [documents.allan("B"), documents.calibration("B", 10.0)]
    docs.append(documents.navigation("B", "full", 10.0, 3.0, 4.0))
    report = gather(documents.write(tmp_path, *docs), "t")
    assert len(report.summary) == len(report.sections) == 3
    without = [name for name, kind in KINDS.items() if not (kind.summary or kind.headline)]
    assert without == ["navigation", "warm-up", "scale-design"]  # verdicts, titles of their tables
