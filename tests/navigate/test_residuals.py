"""What residuals of a window are compared with: lever arm, level, scatter of seconds."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import chi2

from rotcli.models import rotation
from rotcli.models.base import FixedBase
from rotcli.models.expected.sources import AccelSource, AxisSource, still_contrast
from rotcli.models.mean_covariance import SlowNoise
from rotcli.navigate.level import estimate_level
from rotcli.navigate.residuals import WindowResiduals, _lever_arm_acceleration
from rotcli.navigate.verdict import _chi2_p
from rotcli.units import DEG

UP = np.array([0.0, 0.0, 1.0])


def test_the_lever_arm_acceleration_of_a_ramp_is_the_integral_over_each_block():
    axis, arm, length = np.array([0.6, 0.0, 0.8]), np.array([0.3, -0.2, 0.1]), 1.0
    slope, first = 0.4, 1.5  # rad/s^2, rad/s at the start

    def at(t, k):
        w = (first + slope * t) * axis
        return (np.cross(w, np.cross(w, arm)) + np.cross(slope * axis, arm))[k]

    rate = first + slope * (np.arange(6) + 0.5)
    expected = [[quad(at, n, n + 1, args=(k,))[0] for k in range(3)] for n in range(6)]
    found = _lever_arm_acceleration(axis, arm, rate, length)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_the_level_of_a_turning_table_is_found_free_of_bias_and_with_its_sigma():
    # An IMU of white noise alone, upright in the rig, on a table pitched by 0.3 and rolled by
    # -0.2 deg: sigma of both components of gravity is N/sqrt(T).
    white, n, rate = 1e-3, 400, 30.0 * DEG
    base = FixedBase(0.9, 9.81, np.eye(3))
    contrast = still_contrast(0.0, 60.0)
    source = AccelSource((AxisSource(white, SlowNoise(0.0, 0.0), contrast),), np.zeros(3))
    tilted = rotation.attitude_matrix(0.3 * DEG, -0.2 * DEG, 0.0).T @ [0.0, 0.0, 9.81]
    angle = rate * (np.arange(n) + 0.5)
    wrong = rotation.rotate_about(UP, -angle, np.tile(tilted - base.specific_force, (n, 1)))
    wrong *= np.sinc(rate / (2.0 * np.pi))  # the mean over a block
    errors = []
    for seed in range(40):
        noise = white * np.random.default_rng(seed).standard_normal((n, 3))
        accel = wrong + noise + [0.02, -0.03, 0.05]
        residuals = WindowResiduals(
            121.0, 1.0, np.zeros((n, 3)), accel, np.full(n, rate), angle, np.zeros(3)
        )
        found = estimate_level(residuals, UP, base, source)
        assert found.significant
        errors += [found.pitch - 0.3 * DEG, found.roll + 0.2 * DEG]
    assert found.sigma == pytest.approx(white / np.sqrt(n) / 9.81)
    # Eighty draws know their spread to 8 %; the mean over a block hides 1.2 % of the rotation.
    assert np.std(errors) == pytest.approx(found.sigma, rel=0.25)
    assert abs(np.mean(errors)) < 4.0 * found.sigma / np.sqrt(80)


@pytest.mark.parametrize("dof", [300, 899])
@pytest.mark.parametrize("tail", [3e-2, 1e-3, 1e-5])
def test_p_of_a_scatter_is_that_of_chi_squared_for_six_figures_and_both_tails(dof, tail):
    for per_dof in (chi2.isf(tail / 2.0, dof) / dof, chi2.ppf(tail / 2.0, dof) / dof):
        # Wilson and Hilferty err by a few percent so far in the tails.
        assert _chi2_p(per_dof, dof) == pytest.approx(6.0 * tail, rel=0.1)
