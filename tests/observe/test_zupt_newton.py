"""The filter's updates solved together, against one update after the other."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.models.kalman import gain_sequence
from rotcli.observe.zupt import filter as zupt_filter
from rotcli.observe.zupt import kalman_blocks, newton
from rotcli.observe.zupt.filter import ZuptFilter, run, smooth_updates
from rotcli.observe.zupt.model import InitialSigma, build_update_model
from rotcli.observe.zupt.newton import rotation_matrices, solve_updates
from rotcli.observe.zupt.updates import FilterState, filter_updates, preintegrate_updates
from rotcli.units import DEG

from .zupt_truth import DT, perfect, sensors, settings, staircase

CASES = {
    "scale": ("z30", {"initial": InitialSigma(scale=3e-3)}),
    "still": ("still", {}),
    "lever arm": (
        "x30",
        {
            "lever_arm": (0.05, -0.03, 0.08),
            "estimate_lever_arm": True,
            "initial": InitialSigma(scale=2e-3),
        },
    ),
    "means": ("y30", {"samples_are_means": True, "samples": 7}),
}


def made(case, seconds=150.0, tilt=0.0):
    """Return the model and the readings of a log with a still and a turning segment."""
    name, more = CASES[case]
    s = settings(name, **more)
    theta, rate, acceleration = staircase((0, 20), (0 if case == "still" else 40, seconds))
    C_nb = rotation_matrices(np.array([[tilt, 0.0, 0.0]]))[0] @ s.C_nb
    log = perfect(C_nb, s.axis, theta, rate, s.lever_arm, acceleration)
    gyro, accel, _, _ = sensors(np.random.default_rng(4), log)
    return build_update_model(theta, DT, s), gyro, accel


@pytest.mark.parametrize("case", CASES)
def test_the_covariance_in_blocks_is_the_recursion_of_one_update_after_the_other(case):
    model, _, _ = made(case)
    linear = model.linear
    assert len(linear) % kalman_blocks.BLOCK  # a remainder is among them
    # The rig's lever arm makes the noise of the measurements differ from update to update.
    assert (linear.more_variance is not None) == (case == "lever arm")
    noise = linear.measurement_noise
    expected = gain_sequence(model.P0, linear.Phi, linear.Q, linear.H, noise)
    gains = kalman_blocks.blocked_gains(model.P0, linear, covariances=True)
    sigma = expected.sigma
    # Rounding: 1e-16 for each update, amplified where a direction is not observed.
    np.testing.assert_allclose(gains.sigma, sigma, rtol=2e-11)
    np.testing.assert_allclose(gains.S, expected.S, rtol=1e-10, atol=1e-10 * linear.R[0, 0])
    scale = sigma[:, :, None] / np.sqrt(np.diagonal(expected.S, axis1=1, axis2=2))[:, None, :]
    assert np.abs((gains.K - expected.K) / scale).max() < 1e-10
    for name in ("prior", "posterior"):
        a, b = getattr(gains, name), getattr(expected, name)
        product = sigma[:, :, None] * sigma[:, None, :]
        assert np.abs((a - b) / product).max() < 1e-10
    np.testing.assert_array_equal(gains.P, gains.posterior[-1])
    plain = kalman_blocks.blocked_gains(model.P0, linear)
    np.testing.assert_array_equal(plain.K, gains.K)


@pytest.mark.parametrize("tilt", [0.0, 2.0 * DEG])
@pytest.mark.parametrize("case", CASES)
def test_updates_solved_together_are_those_of_one_after_the_other(case, tilt, monkeypatch):
    model, gyro, accel = made(case, tilt=tilt)
    gains = model.gains(model.P0)
    increments = preintegrate_updates(model, gyro, accel)
    start = FilterState(
        np.eye(3), model.lever_arm_velocity[0], np.zeros(len(model.settings.states) - 6)
    )
    expected, _ = filter_updates(model, increments, start, gains, model.P0)
    monkeypatch.setattr(newton, "PART", 500)  # several parts
    monkeypatch.setattr(newton, "filter_updates", None)  # no part falls back to the reference
    together = solve_updates(model, increments, start, gains)
    sigma = gains.sigma
    # TOLERANCE is 1e-11 of a sigma; the closed loop forgets most of it.
    assert np.abs((together.velocity - expected.velocity) / sigma[:, :3]).max() < 1e-10
    assert np.abs((together.bias_estimates - expected.bias_estimates) / sigma[:, 6:]).max() < 1e-10
    assert np.abs(together.C_error - expected.C_error).max() < 1e-10 * sigma[:, 3:5].min()
    total = np.cumsum(together.azimuth - expected.azimuth)
    assert np.abs(total / sigma[:, 5]).max() < 1e-10
    assert np.abs(together.innovations - expected.innovations).max() < 1e-10 * 2e-3


def test_a_log_with_a_jump_is_filtered_one_update_after_the_other():
    model, gyro, accel = made("scale")
    gyro[5000:5010] += 40.0  # rad/s: the attitude jumps by 4 rad
    gains = model.gains(model.P0)
    increments = preintegrate_updates(model, gyro, accel)
    start = FilterState(np.eye(3), np.zeros(3), np.zeros(len(model.settings.states) - 6))
    expected, _ = filter_updates(model, increments, start, gains, model.P0)
    together = solve_updates(model, increments, start, gains)
    np.testing.assert_allclose(together.velocity[:480], expected.velocity[:480], atol=1e-13)
    assert np.abs(expected.velocity[-1]).max() < np.inf
    np.testing.assert_allclose(together.velocity, expected.velocity, rtol=1e-6, atol=1e-9)


def test_smoothing_with_gains_in_blocks_is_smoothing_one_after_the_other(monkeypatch):
    model, gyro, accel = made("lever arm")
    model = replace(model, settings=replace(model.settings, smooth=True))
    monkeypatch.setattr(zupt_filter, "MIN_TOGETHER", 100)
    together = run(model, gyro, accel)
    monkeypatch.setattr(kalman_blocks, "MIN_BLOCKS", 10**9)
    monkeypatch.setattr(zupt_filter, "MIN_TOGETHER", 10**9)
    expected = run(model, gyro, accel)
    assert np.abs((together.values - expected.values) / expected.sigma).max() < 1e-9
    np.testing.assert_allclose(together.sigma, expected.sigma, rtol=1e-9)
    np.testing.assert_allclose(together.nis, expected.nis, rtol=1e-8, atol=1e-9)
    part = ZuptFilter(model.settings, len(model.rate)).advance(model, gyro, accel)
    assert smooth_updates(model, part)[0].sigma.shape == expected.sigma.shape


def test_rotation_matrices_of_small_and_of_large_vectors_are_exponentials():
    from scipy.spatial.transform import Rotation

    phi = np.random.default_rng(1).normal(size=(50, 3))
    for size in (1e-9, 1e-3, 0.02, 1.0):
        expected = Rotation.from_rotvec(size * phi).as_matrix()
        np.testing.assert_allclose(rotation_matrices(size * phi), expected, atol=1e-15)
