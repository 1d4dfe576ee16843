"""Several calibrations together: every error counts once; blocks of a log."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.errors import LogError, ResultError
from rotcli.logs.record import ImuLog, Segment
from rotcli.models.triad import parameters as p
from rotcli.run.corrections import TriadCorrection
from rotcli.run.laboratory.blocks import reduce_blocks, split_segments
from rotcli.run.laboratory.corrections import bind, combine, read_scale, read_thermal

DEG = np.pi / 180
DPH = DEG / 3600
T = [0.0, 10.0, 20.0, 30.0, 40.0]


def thermal_doc():
    gyro = {"bias": [10.0, 20, 30, 40, 50], "scale_ppm": [100.0] * 5}
    accel = {"bias": [0.01] * 5}
    curve = {"temperature_degC": T, **{f"gyro_{a}": gyro for a in "xyz"}}
    return {
        "axis": "z",
        "curve": {**curve, **{f"accel_{a}": accel for a in "xyz"}},
        "blocks": [
            {"rate_dps": rate, "start_s": 500.0, "end_s": 500.0 + seconds}
            for rate, seconds in ((0.0, 60.0), (50.0, 30.0), (-50.0, 30.0))
        ],
    }


def scale_doc(quadratic=100.0):
    """e = quadratic x^2 + 360 x deg/h of gyro z, x = w / 100 deg/s; biases of 7 deg/h."""
    x = np.linspace(-1, 1, 5)
    none = {"model": "line", "coefficients_dph": [0.0], "values_dph": [0.0] * 5, "slope_ppm": 0.0}
    values = 360 * x + quadratic * x**2
    z = {
        "model": "quad",
        "coefficients_dph": [360.0, quadratic],
        "values_dph": list(values),
        "slope_ppm": 1000.0,
    }
    return {
        "axis": "z",
        "parameters": {f"bias_{a}": {"value": 7.0} for a in "xyz"},
        "curve": {
            "full_scale_dps": 100.0,
            "knots_dps": list(100 * x),
            "gyros": {"x": none, "y": none, "z": z},
        },
    }


def triad():
    x = np.zeros(p.count())
    x[p.N] = np.arange(1, 10) * 1e-3
    x[p.GYRO_BIAS] = 5 * DPH
    return TriadCorrection("triad.json", None, x)


def log(rates, temperature=None, seconds=2.0):
    n = 50
    time = np.linspace(0, seconds, n)
    gyro = np.tile(np.asarray(rates, float) * DEG, (n, 1))
    return ImuLog("imu.csv", time, gyro, np.zeros((n, 3)), seconds / (n - 1))


def test_a_thermal_calibration_takes_bias_and_axis_column_from_a_triad_one():
    documents = [("triad.json", "triad", {}), ("t.json", "thermal", thermal_doc())]
    found = combine(
        documents, {"triad.json": triad(), "t.json": read_thermal("t.json", thermal_doc())}
    )
    assert [c.path for c in found] == ["t.json", "triad.json"]
    x = found[1].x
    assert not np.any(x[p.GYRO_BIAS])
    N = x[p.N].reshape(3, 3)
    np.testing.assert_allclose(N, np.arange(1, 10).reshape(3, 3) * 1e-3 * [1, 1, 0])


def test_a_scale_curve_next_to_a_thermal_one_has_neither_its_bias_nor_its_line():
    documents = [("s.json", "scale", scale_doc()), ("t.json", "thermal", thermal_doc())]
    corrections = {
        "s.json": read_scale("s.json", scale_doc()),
        "t.json": read_thermal("t.json", thermal_doc()),
    }
    _, scale = combine(documents, corrections)
    assert not scale.with_bias
    # e at 0, 50 s and +-50 deg/s, 30 s each: 0 and 25 +- 180 deg/h; line: 12.5 + 360 x.
    np.testing.assert_allclose(scale.removed[0] / DPH, [0, 0, 12.5], atol=1e-9)
    np.testing.assert_allclose(scale.removed[1] * 1e6, [0, 0, 1000], atol=1e-9)
    gyro, _ = scale.apply(log([0, 0, 100.0]))
    # e(100) minus its line is 100 - 12.5 deg/h; the curve is read at the corrected rate.
    np.testing.assert_allclose(gyro[:, 2], 100 * DEG - 87.5 * DPH, atol=0.06 * DPH)


def test_a_scale_curve_alone_corrects_its_bias():
    (scale,) = combine(
        [("s.json", "scale", scale_doc())], {"s.json": read_scale("s.json", scale_doc())}
    )
    gyro, accel = scale.apply(log([0, 0, 50.0]))
    # 7 deg/h of bias and e(50) = 205 deg/h; the curve is read at the corrected rate.
    np.testing.assert_allclose(gyro[:, 2], 50 * DEG - 212 * DPH, atol=0.3 * DPH)
    np.testing.assert_allclose(gyro[:, 0], -7 * DPH, atol=1e-12)
    assert not np.any(accel)
    gyro, _ = scale.biases_alone().apply(log([0, 0, 50.0]))
    np.testing.assert_allclose(gyro[:, 2], 50 * DEG - 7 * DPH)


def test_a_rate_outside_a_scale_curve_is_refused_with_the_rate_less_the_bias():
    doc = scale_doc()
    doc["parameters"] = {f"bias_{a}": {"value": 36000.0} for a in "xyz"}  # 10 deg/s
    scale = read_scale("s.json", doc)
    assert scale.apply(log([0, 0, 109.9]))[0].shape == (50, 3)
    text = r"imu\.csv: 105 deg/s at 0 s is outside -100 to 100 deg/s, the rates of s\.json"
    with pytest.raises(LogError, match=text):
        scale.apply(log([0, 0, 115.0]))
    with pytest.raises(LogError, match="-105 deg/s at 0 s is outside"):
        scale.apply(log([0, 0, -95.0]))
    (clamped,), warnings = bind([scale], log([0, 0, 115.0]), None, clamp=True)
    assert warnings == [
        "imu.csv: 50 samples are outside -100 to 100 deg/s of s.json. The slope of its straight "
        "line is used there"
    ]
    assert np.all(np.isfinite(clamped.apply(log([0, 0, 115.0]))[0]))


@pytest.mark.parametrize(("samples", "outside"), [(99, False), (100, True)])
def test_rates_outside_a_scale_curve_are_means_over_a_second(samples, outside):
    imu = log([0, 0, 0], seconds=2.0)
    time, gyro = 0.01 * np.arange(1000), np.zeros((1000, 3))
    gyro[400 : 400 + samples, 2] = 101.5 * DEG  # a hundredth is granted
    imu = replace(imu, time=time, gyro=gyro, accel=np.zeros((1000, 3)), interval=0.01)
    assert np.any(read_scale("s.json", scale_doc()).outside(imu)) == outside


def test_a_thermal_correction_follows_the_temperature():
    (thermal,), warnings = bind([read_thermal("t.json", thermal_doc())], log([0, 0, 0]), 20.0)
    assert not warnings
    gyro, accel = thermal.apply(log([0, 0, 50.0]))
    expected = (50 * DEG - 30 * DPH) / (1 + 1e-4)
    np.testing.assert_allclose(gyro[:, 2], expected, rtol=1e-9)
    np.testing.assert_allclose(gyro[:, 0], -30 * DPH - 1e-4 * expected, rtol=1e-6)
    np.testing.assert_allclose(accel, -0.01)
    gyro, _ = thermal.biases_alone().apply(log([0, 0, 50.0]))
    np.testing.assert_allclose(gyro[:, 2], 50 * DEG - 30 * DPH)


def test_temperatures_outside_are_refused_or_clamped():
    correction = read_thermal("t.json", thermal_doc())
    (hot,), _ = bind([correction], log([0, 0, 0]), 45.0)
    with pytest.raises(LogError, match=r"45\.0 degC at 0 s is outside 0\.0 to 40\.0 degC"):
        hot.apply(log([0, 0, 0]))
    (clamped,), warnings = bind([correction], log([0, 0, 0], seconds=10.0), 45.0, clamp=True)
    assert "outside 0.0 to 40.0 degC" in warnings[0]
    _, warnings = bind([correction], log([0, 0, 0], seconds=200.0), 45.0, clamp=True)
    assert "imu.csv: 49 samples (200 s), first at 0 s, are outside" in warnings[0]
    gyro, _ = clamped.apply(log([0, 0, 0]))
    np.testing.assert_allclose(gyro[:, 2], -50 * DPH / (1 + 1e-4), rtol=1e-6)
    with pytest.raises(LogError, match="no temperature column"):
        correction.apply(log([0, 0, 0]))


def test_contradicting_calibrations_are_refused():
    thermal = ("t.json", "thermal", thermal_doc())
    with pytest.raises(ResultError, match="omit this calibration"):
        combine([thermal, ("c.json", "column", {})], {})
    with pytest.raises(ResultError, match="a second calibration of model thermal"):
        combine([thermal, thermal], {})


def test_an_invalid_document_is_one_error():
    with pytest.raises(ResultError, match=r"s\.json"):
        read_scale("s.json", {"axis": "z"})
    with pytest.raises(ResultError, match=r"t\.json"):
        read_thermal("t.json", {"axis": "q", "curve": {}})


def test_blocks_are_means_minus_the_true_rate():
    imu = log([0, 0, 50.0], seconds=20.0)
    segments = [Segment(0.0, 9.0, 50 * DEG, 450 * DEG), Segment(9.0, 20.0, 49 * DEG, 539 * DEG)]
    found = reduce_blocks(imu, None, segments, axis=np.array([0, 0, 1.0]), base=None)
    np.testing.assert_allclose(found.gyro.mean[:, 2] / DEG, [0, 1], atol=1e-12)
    assert found.accel is None
    for first in (0.0, 9.0):  # a sample is every 0.41 s
        short = [Segment(first, first + 1.0)]
        text = f"3 samples from {first:g} to {first + 1.0:g} s; 5 are needed"
        with pytest.raises(LogError, match=text):
            reduce_blocks(imu, None, short, axis=np.array([0, 0, 1.0]), base=None)


def test_long_segments_are_divided_into_at_most_a_thousand_blocks():
    (day,) = [Segment(0.0, 86400.0)]
    assert len(split_segments([day], None)) == 1
    blocks = split_segments([day], 60.0)
    assert 900 < len(blocks) <= 1000
    assert blocks[0].end == pytest.approx(86400 / len(blocks))
    assert len(split_segments([Segment(0.0, 125.0)], 60.0)) == 2
    with pytest.raises(ValueError, match="at most 2000"):
        split_segments([Segment(float(k), k + 0.5) for k in range(2001)], None)
