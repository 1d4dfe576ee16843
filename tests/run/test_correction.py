"""A single-axis calibration document, read back: its units, and where it applies."""

import numpy as np
import pytest

from rotcli.errors import ResultError
from rotcli.run.correction import correction_from_document

DEG = np.pi / 180
Z = np.array([0.0, 0.0, 1.0])


def document(**more):
    biases = dict(zip("xyz", (1.0, -2.0, 3.0), strict=True))
    parameters = {f"bias_{a}": {"value": 10.0 * v} for a, v in biases.items()}
    parameters |= {f"accel_bias_{a}": {"value": 0.01 * v} for a, v in biases.items()}
    parameters |= {n: {"value": v} for n, v in (("Kgxz", 50.0), ("Kgyz", -60.0), ("Kgz", 700.0))}
    segments = [
        {"rate_dps": 20.0, "start_s": 100.0, "end_s": 160.0},
        {"rate_dps": 0.0, "start_s": 0.0, "end_s": 60.0},
        {"rate_dps": -40.0, "start_s": 200.0, "end_s": 260.0},
    ]
    return {"axis": "z", "parameters": parameters, "segments": segments, **more}


def test_the_figures_of_a_document_are_read_in_its_units():
    found = correction_from_document(document(), "c.json")
    np.testing.assert_allclose(found.gyro_bias, np.array([10, -20, 30]) * DEG / 3600, rtol=1e-12)
    np.testing.assert_allclose(found.accel_bias, [0.01, -0.02, 0.03], rtol=1e-12)
    np.testing.assert_allclose(found.gyro_column, [50e-6, -60e-6, 700e-6], rtol=1e-12)
    np.testing.assert_allclose(found.segment_rates, np.array([20, 0, -40]) * DEG, rtol=1e-12)
    np.testing.assert_allclose(found.rates, np.array([20, -40]) * DEG, rtol=1e-12)
    assert found.segments_used == ((100.0, 160.0), (0.0, 60.0), (200.0, 260.0))
    np.testing.assert_allclose(
        found.gyro_errors(full=True).matrix, np.outer([50e-6, -60e-6, 700e-6], Z), rtol=1e-12
    )


def test_it_applies_at_its_own_rates_in_both_senses_to_a_hundredth():
    found = correction_from_document(document(), "c.json")
    for rate in (20.0, -20.0, 20.199, 19.801, 40.399, -39.601):
        assert found.check_applies(Z, rate * DEG, constant_rate=True) is None
    for rate in (20.201, 19.799, -40.401, 39.599, 0.0, 30.0):
        text = found.check_applies(Z, rate * DEG, constant_rate=True)
        assert text.startswith("c.json: made at 20, -40 deg/s, but in the window the table turns")


def test_it_applies_about_its_own_axis_in_both_senses_to_eight_hundredths_of_a_degree():
    found = correction_from_document(document(), "c.json")
    for angle in (0.0808, np.degrees(np.pi) - 0.0808):  # arccos(1 - 1e-6) is 0.08103 deg
        axis = np.array([np.sin(angle * DEG), 0.0, np.cos(angle * DEG)])
        assert found.check_applies(axis, 20.0 * DEG, constant_rate=True) is None
    axis = np.array([np.sin(0.0813 * DEG), 0.0, np.cos(0.0813 * DEG)])
    with pytest.raises(ResultError, match="calibrate about the same axis"):
        found.check_applies(axis, 20.0 * DEG, constant_rate=True)


def test_a_window_may_share_a_fiftieth_with_the_data_of_the_calibration():
    inputs = [{"rows": 5000, "start_s": 0.0, "end_s": 300.0}]
    found = correction_from_document(document(inputs=inputs), "c.json")
    log = (5000.0, 0.0, 300.0)
    # From 160 s to 200 s nothing was used: of 41 s one in forty-one is shared at either end.
    assert found.check_independent(log, (160.0, 200.0)) is None
    assert found.check_independent(log, (159.3, 199.0)) is None  # 0.7 of 39.7 s
    text = found.check_independent(log, (159.0, 199.0))  # 1 of 40 s
    assert "was made on 1 s of the 40 s navigated" in text
    text = found.check_independent(log, (130.0, 230.0))  # 30 s of two segments each
    assert "was made on 60 s of the 100 s navigated" in text
    assert found.check_independent((5001.0, 0.0, 300.0), (130.0, 230.0)) is None
