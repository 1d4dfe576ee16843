"""The zero-velocity filter against published-style sigmas and simulated truth."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rotcli.models.kalman import mean_bounds, normalized_squares
from rotcli.models.rotation import axis_rotation, euler_angles, skew
from rotcli.observe.zupt.filter import ERROR_SIGNS, run
from rotcli.observe.zupt.model import InitialSigma, Noise, build_update_model
from rotcli.observe.zupt.updates import preintegrate_updates, propagate
from rotcli.units import DEG, DEG_PER_HOUR, wrap_pi

from .zupt_truth import DT, TURN_ON, drawn, perfect, sensors, settings, staircase, steady

# Final 1-sigma of the reference run: eps E N U deg, accel x y z m/s^2, gyro x y z deg/h.
# Deterministic; kept in the project's list of numbers for this filter.
FINAL_SIGMA = {
    "still": (0.1207, 0.1207, 83.66, 0.01993, 0.01993, 0.00036, 23.70, 23.70, 505.7),
    "y0": (0.1207, 0.0321, 1.236, 0.00044, 0.01993, 0.00042, 27.75, 23.70, 28.63),
    "y30": (0.0322, 0.0322, 1.426, 0.00047, 0.00052, 0.00046, 26.40, 25.50, 26.98),
    "z0": (0.1195, 0.1195, 83.66, 0.01972, 0.01972, 0.00036, 76.13, 76.13, 505.7),
    "z30": (0.0322, 0.0323, 2.466, 0.00062, 0.00061, 0.00039, 24.50, 24.67, 33.58),
    "x30": (0.0322, 0.0322, 1.426, 0.00052, 0.00047, 0.00046, 25.50, 26.40, 26.98),
}
# RMS over runs and time of roll, pitch, azimuth error, deg.
MONTE_CARLO = {
    "still": (0.133, 0.125, 43),
    "y0": (0.029, 0.112, 0.94),
    "y30": (0.034, 0.032, 0.96),
    "z0": (0.123, 0.124, 46),
    "z30": (0.035, 0.031, 1.7),
    "x0": (0.130, 0.030, 0.77),
    "x30": (0.031, 0.030, 1.1),
}
UNITS = np.repeat([DEG, 1.0, DEG_PER_HOUR], 3)


def final_covariance(p):
    return p.gains(p.P0).P


def run_all(p, gyro, accel):
    """Many logs (runs, n, 3) of one table motion: values (runs, n, m) …, sigma of the first."""
    gains = p.gains(p.P0) if p.settings.slave_azimuth else None
    found = [run(p, *log, gains) for log in zip(gyro, accel, strict=True)]
    stacked = {
        name: np.array([getattr(e, name) for e in found])
        for name in ("values", "attitude_errors", "nis", "P")
    }
    return SimpleNamespace(sigma=found[0].sigma, **stacked)


@pytest.mark.parametrize("case", FINAL_SIGMA)
def test_final_sigmas_of_the_reference_run(case):
    theta, _ = steady(case)
    sigma = (
        np.sqrt(np.diag(final_covariance(build_update_model(theta, DT, settings(case)))))[3:]
        / UNITS
    )
    # Deterministic: 1 %, and the rounding of the accelerometers' five printed decimals.
    np.testing.assert_allclose(sigma, FINAL_SIGMA[case], rtol=0.01, atol=0.6e-5)


def monte_carlo(case, runs, seed):
    """Logs of `runs` runs with turn-on biases and attitude errors drawn from the prior."""
    rng = np.random.default_rng(seed)
    s = settings(case)
    theta, rate = steady(case)
    # The table's attitude is known to 0.2 deg. (At 1 deg the sensor axes themselves are turned by
    # as much against the gains' linearization: 0.02 m/s^2 * 1 deg is one sigma of the vertical
    # accelerometer bias. Such a table is warned about.)
    draws = drawn(rng, runs, InitialSigma(tilt=0.2 * DEG))
    logs, C_true = [], []
    for d in draws:
        C_nb = (np.eye(3) - skew(d[6:]) + 0.5 * skew(d[6:]) @ skew(d[6:])) @ s.C_nb
        log = perfect(C_nb, s.axis, theta, rate)
        logs.append(sensors(rng, log, turn_on=(d[:3], d[3:6])))
        C_true.append(C_nb)
    return s, theta, [np.array(a) for a in zip(*logs, strict=True)], np.array(C_true)


def check_monte_carlo(case, runs=40):
    s, theta, (gyro, accel, b_a, b_g), C_true = monte_carlo(case, runs, seed=20)
    result = run_all(build_update_model(theta, DT, s), gyro, accel)
    given = np.array(euler_angles(s.C_nb))
    offset = np.array(euler_angles(C_true)).T - given
    errors = wrap_pi(result.attitude_errors - offset[:, None, :])
    rms = np.sqrt((errors**2).mean(axis=(0, 1)))[[1, 0, 2]] / DEG
    np.testing.assert_allclose(rms, MONTE_CARLO[case], rtol=0.2)
    # Every bias within 4.5 sigma in every run: 240 draws, one in 600 such sets would fail.
    miss = np.concatenate(
        [result.values[:, -1, 6:9] - b_a[:, -1], result.values[:, -1, 9:] - b_g[:, -1]], axis=1
    )
    assert np.abs(miss / result.sigma[-1, 6:]).max() < 4.5
    # And the sigmas are not idle: Gauss-Markov truth is a little tamer than the random walk.
    spread = np.sqrt(((miss / result.sigma[-1, 6:]) ** 2).mean())
    assert 0.7 < spread < 1.15


@pytest.mark.campaign
@pytest.mark.parametrize("case", sorted(MONTE_CARLO))
def test_monte_carlo_rms_of_the_attitude(case):
    check_monte_carlo(case)


def test_transition_is_the_derivative_of_the_nonlinear_mechanization():
    s = settings("y30", slave_azimuth=False, initial=InitialSigma(scale=1e-3))
    theta, rate = steady("y30", 1.0, 100.0 * DEG)
    gyro, accel = perfect(s.C_nb, s.axis, theta, rate)
    p = build_update_model(theta, DT, s)
    k, h = 3, 1e-6
    increments = preintegrate_updates(p, gyro, accel)

    def after(x):
        """Computed state from an error x: computed minus true, and true minus estimated."""
        return propagate(increments, k, np.eye(3) + skew(x[3:6]), x[:3], -x[6:])

    measured = np.zeros((6, 15))
    for j in range(15):
        x = np.zeros(15)
        x[j] = h
        (M_up, v_up), (M_down, v_down) = after(x), after(-x)
        E = (M_up - M_down) @ after(np.zeros(15))[0].T / (2.0 * h)
        measured[:3, j] = (v_up - v_down) / (2.0 * h)
        measured[3:, j] = 0.5 * np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]])
    # Phi is I + F tau with the coupling integrals: what it leaves out is of second order in the
    # Earth rate's turn over an update (7e-6 rad), times g tau = 1 m/s; and J1, J2 are midpoint
    # sums where the mechanization's are trapezoids: (turn per sample)^2 / 12 = 3e-5 of 0.01.
    np.testing.assert_allclose(p.linear.rows[k], measured, atol=8e-6)
    assert np.abs(measured[:3, 9:12]).max() > 0.01  # the couplings are there to be wrong


@pytest.mark.parametrize("averages", [False, True])
@pytest.mark.parametrize("case", ["y30", "z30", "x0"])
def test_an_error_free_log_gives_no_biases(case, averages):
    s = settings(case, samples_are_means=averages)
    theta, rate = steady(case, 60.0, 100.0 * DEG)
    if averages:  # the mean of a turning vector over a sample: that at the middle, shortened
        middle = np.append(theta[0], 0.5 * (theta[1:] + theta[:-1]))
        gyro, accel = perfect(s.C_nb, s.axis, middle, rate)
        along = (accel @ s.axis)[:, None] * s.axis
        accel = along + (accel - along) * np.sinc(rate[0] * DT / 2.0 / np.pi)
    else:
        gyro, accel = perfect(s.C_nb, s.axis, theta, rate)
    last = run(build_update_model(theta, DT, s), gyro, accel).values[-1]
    # A hundredth of the filter's sigma of a real log; 1.7 deg are turned per sample.
    assert np.abs(last[6:9]).max() < 1e-5
    assert np.abs(last[9:12]).max() < 0.2 * DEG_PER_HOUR
    assert np.abs(last[3:6]).max() < 1e-3 * DEG


def matched(case, runs, seconds, seed):
    """Logs whose truth is the filter's own model: random-walk biases, 2 mm/s of real jitter."""
    rng = np.random.default_rng(seed)
    initial = InitialSigma(tilt=0.2 * DEG)
    s = settings(case, samples_are_means=True, initial=initial)
    theta, rate = steady(case, seconds)
    n, noise, tau = len(theta), s.noise, s.samples * DT
    draws = drawn(rng, runs, initial)
    gyros, accels, truths = [], [], []
    for d in draws:
        C_nb = (np.eye(3) - skew(d[6:]) + 0.5 * skew(d[6:]) @ skew(d[6:])) @ s.C_nb
        middle = np.append(theta[0], 0.5 * (theta[1:] + theta[:-1]))
        gyro, accel = perfect(C_nb, s.axis, middle, rate)
        walk = np.cumsum(rng.normal(size=(n, 6)), axis=0) * np.sqrt(2.0 * DT / 120.0)
        b_a, b_g = (
            d[:3] + walk[:, :3] * noise.accel_markov_sigma,
            d[3:6] + walk[:, 3:] * noise.gyro_markov_sigma,
        )
        gyro = gyro + b_g + noise.angle_random_walk / np.sqrt(DT) * rng.normal(size=(n, 3))
        accel = accel + b_a + noise.velocity_random_walk / np.sqrt(DT) * rng.normal(size=(n, 3))
        # Jitter of the table's own velocity, changing from update to update; the computed
        # velocity starts at rest, the true one at the initial sigma.
        v = rng.normal(size=((n - 1) // s.samples + 1, 3)) * s.velocity_sigma
        v[0] *= initial.velocity / s.velocity_sigma
        disturbance = np.repeat(np.diff(v, axis=0) / tau, s.samples, axis=0)
        C_ns = C_nb @ axis_rotation(s.axis, middle[1:])
        accel[1:] += np.einsum("kji,kj->ki", C_ns, disturbance)
        gyros.append(gyro)
        accels.append(accel)
        truths.append(np.concatenate([v[-1], ERROR_SIGNS[3:6] * d[6:], b_a[-1], b_g[-1]]))
    return s, theta, np.array(gyros), np.array(accels), np.array(truths)


@pytest.mark.parametrize("case", ["y30", "z30"])
def test_nees_and_nis_stay_in_their_bands_with_matched_truth(case):
    runs = 12
    s, theta, gyro, accel, truth = matched(case, runs, 100.0, seed=5)
    p = build_update_model(theta, DT, s)
    result = run_all(p, gyro, accel)
    error = ERROR_SIGNS[:12] * (truth - result.values[:, -1])
    error[:, 5] = wrap_pi(error[:, 5])
    nees = normalized_squares(error, final_covariance(p)).mean()
    low, high = mean_bounds(12, runs)
    assert low < nees < high
    low, high = mean_bounds(3, result.nis.size)
    assert low < result.nis.mean() < high


def test_slaving_keeps_the_still_case_honest():
    """A drifting azimuth turns the computed frame, and the filter takes that for information."""
    runs = 10
    rng = np.random.default_rng(8)
    s = settings("still", samples=50)
    theta, rate = steady("still")
    draws = drawn(rng, runs)
    draws[:, 6:8] *= 0.1  # tilts
    logs, truth = [], []
    for d in draws:
        C_nb = (np.eye(3) - skew(d[6:])) @ s.C_nb
        gyro, accel, b_a, b_g = sensors(
            rng, perfect(C_nb, s.axis, theta, rate), turn_on=(d[:3], d[3:6])
        )
        logs.append((gyro, accel))
        truth.append(np.concatenate([ERROR_SIGNS[3:6] * d[6:], b_a[-1], b_g[-1]]))
    gyro, accel = (np.array(a) for a in zip(*logs, strict=True))

    def consistency(slave_azimuth):
        """NEES of attitude and biases (9 states) over the runs, and the mean NIS."""
        result = run_all(
            build_update_model(theta, DT, replace(s, slave_azimuth=slave_azimuth)), gyro, accel
        )
        error = ERROR_SIGNS[3:12] * (np.array(truth) - result.values[:, -1, 3:12])
        error[:, 2] = wrap_pi(error[:, 2])
        P = result.P[..., 3:12, 3:12]
        return normalized_squares(error, np.broadcast_to(P, (runs, 9, 9))).mean(), result.nis.mean()

    slaved, nis_slaved = consistency(True)
    free, nis_free = consistency(False)
    # 18 and 277 were found before; the slaved one varies by a factor of 1.2, the free one by 3.
    assert slaved < 18.0
    assert free > 90.0
    assert abs(nis_free - nis_slaved) < 0.1  # the innovations look healthy either way


ARM = (0.05, -0.03, 0.08)


def lever_arm_run(case, segments, seed=0, lever_arm=ARM, **more):
    s = settings(case, **more)
    theta, rate, acceleration = staircase(*segments)
    log = perfect(s.C_nb, s.axis, theta, rate, lever_arm, acceleration)
    gyro, accel, b_a, b_g = sensors(np.random.default_rng(seed), log)
    return s, run(build_update_model(theta, DT, s), gyro, accel), np.concatenate([b_a[-1], b_g[-1]])


@pytest.mark.parametrize("case", ["y0", "y30", "x30"])
def test_a_lever_arm_comes_back_to_two_millimetres_with_two_rates(case):
    s, result, biases = lever_arm_run(case, [(20, 60), (60, 60)], estimate_lever_arm=True)
    found, sigma = result.values[-1, 12:14], result.sigma[-1, 12:14]
    expected = s.lever_axes.T @ ARM
    assert np.abs(expected).max() >= 0.03
    np.testing.assert_allclose(found, expected, atol=2e-3)
    assert (sigma < 1e-3).all()
    assert (np.abs(found - expected) < 4.0 * sigma).all()
    assert (np.abs(result.values[-1, 6:12] - biases) < 4.0 * result.sigma[-1, 6:12]).all()


def test_at_one_rate_a_lever_arm_hides_in_the_accelerometer_biases():
    s, result, _ = lever_arm_run("y30", [(20, 120)], estimate_lever_arm=True)
    assert (result.sigma[-1, 12:14] > 0.01).all()  # 1 cm and more are left of 10
    P = result.P
    correlation = P[12, 6] / np.sqrt(P[12, 12] * P[6, 6])
    assert abs(correlation) > 0.9
    assert pytest.approx([ARM[0], ARM[2]]) == s.lever_axes.T @ ARM


def test_a_known_lever_arm_is_taken_into_account():
    segments = [(0, 30), (60, 60)]
    _, known, biases = lever_arm_run("y30", segments, lever_arm=ARM)
    _, ignored, _ = lever_arm_run("y30", segments)
    s, reported, _ = lever_arm_run("y30", segments)
    s = replace(s, lever_arm=ARM)
    theta, rate, acceleration = staircase(*segments)
    log = perfect(s.C_nb, s.axis, theta, rate, ARM, acceleration)
    gyro, accel, b_a, b_g = sensors(np.random.default_rng(0), log)
    reported = run(build_update_model(theta, DT, s), gyro, accel)
    biases = np.concatenate([b_a[-1], b_g[-1]])
    miss = np.abs(reported.values[-1, 6:12] - biases) / reported.sigma[-1, 6:12]
    assert miss.max() < 4.0
    # Ignored, 8 cm at 60 deg/s are 0.09 m/s^2 of false accelerometer bias.
    assert np.abs(ignored.values[-1, 6:9] - biases[:3]).max() > 0.05
    assert known.values.shape == reported.values.shape


def test_scale_factor_and_installation_come_out_with_two_rates_and_widen_the_bias_at_one():
    column = np.array([1200.0, -1800.0, 900.0]) * 1e-6
    theta, rate, _ = staircase((10, 100), (60, 100))
    s = settings("y30", initial=InitialSigma(scale=2e-3))
    gyro, accel, _, b_g = sensors(np.random.default_rng(3), perfect(s.C_nb, s.axis, theta, rate))
    gyro = gyro + rate[:, None] * column
    two = run(build_update_model(theta, DT, s), gyro, accel)
    at = s.layout.AXIS_COLUMN
    miss = two.values[-1, at] - column
    assert (np.abs(miss) < 4.0 * two.sigma[-1, at]).all()
    assert (two.sigma[-1, at] < 400e-6).all()
    assert (np.abs(two.values[-1, 9:12] - b_g[-1]) < 4.0 * two.sigma[-1, 9:12]).all()
    # One rate: the bias is uncertain by the scale's share, 2e-3 of 10 deg/s.
    theta, _ = steady("y30", 100.0)
    sigma = np.sqrt(np.diag(final_covariance(build_update_model(theta, DT, s))))[9:12]
    np.testing.assert_allclose(sigma, np.hypot(2e-3 * 10.0 * DEG, 27 * DEG_PER_HOUR), rtol=0.05)


def test_smoothing_brings_the_complete_history_to_the_accuracy_of_its_end():
    rng = np.random.default_rng(12)
    s = settings("y30")
    theta, rate = steady("y30", 120.0)
    logs = [sensors(rng, perfect(s.C_nb, s.axis, theta, rate)) for _ in range(5)]
    gyro, accel, b_a, b_g = (np.array(a) for a in zip(*logs, strict=True))
    truth = np.concatenate([b_a, b_g], axis=2)[:, s.samples :: s.samples]
    plain = run_all(build_update_model(theta, DT, s), gyro, accel)
    smooth = run_all(build_update_model(theta, DT, replace(s, smooth=True)), gyro, accel)
    np.testing.assert_array_equal(plain.values[:, -1], smooth.values[:, -1])
    early = slice(100, 600)
    error_plain = plain.values[:, early, 6:12] - truth[:, early]
    error_smooth = smooth.values[:, early, 6:12] - truth[:, early]
    rms = [np.sqrt((e**2).mean(axis=(0, 1))) for e in (error_plain, error_smooth)]
    assert (rms[1] < 0.75 * rms[0]).all()
    assert (smooth.sigma[early, 6:12] < plain.sigma[early, 6:12]).all()
    spread = np.sqrt(((error_smooth / smooth.sigma[early, 6:12]) ** 2).mean())
    assert 0.6 < spread < 1.3  # consistent: the Gauss-Markov truth is tamer than the model
    tilt = np.sqrt((smooth.values[:, early, 3:5] ** 2).mean())
    assert tilt < np.sqrt((plain.values[:, early, 3:5] ** 2).mean())


def test_noise_and_initial_sigmas_are_those_of_the_reference_run():
    assert Noise().gyro_markov_sigma == pytest.approx(24.0 * DEG_PER_HOUR)
    assert InitialSigma().gyro == pytest.approx(500.0 * DEG_PER_HOUR)
    assert TURN_ON[1][1] == pytest.approx(-1800.0 * DEG_PER_HOUR)
