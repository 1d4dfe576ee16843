"""Predicted sigmas of a scale factor test, against ordinary least squares of white noise."""

import numpy as np
import pytest

from rotcli.models.sensors import NoiseFigures
from rotcli.scale.design import scale_design
from rotcli.units import DEG, DEG_PER_ROOT_HOUR

FIGURES = NoiseFigures(white=0.4 * DEG_PER_ROOT_HOUR)
MEAN = 0.4 / 60.0 / 60.0**0.5  # deg/s, sigma of the mean of a segment of 60 s


def planned(*rates):
    return scale_design(np.array(rates) * DEG, FIGURES, duration=60.0).document["planned"]


def test_rates_of_both_signs_give_scale_factor_asymmetry_and_response():
    found = planned(-100.0, -50.0, 0.0, 50.0, 100.0)
    assert found["scale_ppm"] == pytest.approx(1e6 * MEAN / np.sqrt(25_000.0))
    # |rate| less its mean of 60; the asymmetry is twice its coefficient.
    spread = np.sqrt(40.0**2 + 10.0**2 + 60.0**2 + 10.0**2 + 40.0**2)
    assert found["asymmetry_ppm"] == pytest.approx(2e6 * MEAN / spread)
    assert found["response_ratio"] == pytest.approx(np.sqrt(2.0) * MEAN / 100.0)
    assert found["hysteresis_dph"] is None


def test_a_sweep_up_and_down_gives_the_hysteresis_of_three_pairs():
    # 50, 0 and -50 deg/s are reached from both sides, once each; the first segment from neither.
    found = planned(0.0, 50.0, 100.0, 50.0, 0.0, -50.0, -100.0, -50.0, 0.0)
    assert found["hysteresis_dph"] == pytest.approx(3600.0 * MEAN * np.sqrt(2.0 / 3.0))


def test_one_sign_gives_no_asymmetry_and_no_response():
    found = planned(0.0, 50.0, 100.0)
    assert found["asymmetry_ppm"] is None
    assert found["response_ratio"] is None
