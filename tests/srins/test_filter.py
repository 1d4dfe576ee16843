"""The 16-state filter against published sigmas, a closed form and its own truth over many runs."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import chi2

from rotcli.models import earth
from rotcli.srins import model
from rotcli.srins.filter import FilterSettings, build_filter_model, gain_sequence, run_filter
from rotcli.srins.model import GYRO_BIAS_Z
from rotcli.srins.reciprocation import RotationScheme
from rotcli.units import DEG_PER_HOUR

DEG = np.pi / 180
LATITUDE = 42.3 * DEG
HOURS = np.array([1, 2, 3, 4, 6, 8, 10])
PUBLISHED = np.array([7.016, 3.157, 1.769, 1.164, 0.653, 0.442, 0.333])  # 1e-3 deg/h


def steps_of(settings, hours=10.0, kind="one-stop", block=1.0):
    """Return the steps of a cruise at 1 m/s east with one GNSS epoch a second."""
    n = round(hours * 3600 / block)
    theta = RotationScheme(kind=kind).angle(block * np.arange(n + 1))
    velocity = np.ones((2, n + 1)) * [[1.0], [0.0]]
    latitude = np.full(n + 1, LATITUDE)
    return build_filter_model(
        theta, velocity, latitude, block, settings, np.ones(n, dtype=np.int64)
    )


def sigmas(settings, **run):
    P0 = np.diag(settings.initial_sigma(LATITUDE) ** 2)
    return gain_sequence(steps_of(settings, **run), P0).sigma


@pytest.mark.parametrize(
    "settings",
    [
        FilterSettings(),
        FilterSettings(measured_damping=False, reference_white=0.0),
        FilterSettings(damping=model.Damping(enabled=0.0), measured_damping=False),
    ],
    ids=["measured damping states", "estimated damping states", "no damping"],
)
def test_sigma_of_the_axial_drift_falls_as_published_damped_or_not(settings):
    sigma = sigmas(settings)[HOURS * 360 - 1, GYRO_BIAS_Z] / DEG_PER_HOUR * 1e3
    np.testing.assert_allclose(sigma, PUBLISHED, rtol=0.01)


def test_sigma_of_the_axial_drift_follows_its_closed_form():
    # A straight line fitted to the integral of white noise, from two hours on, within 2 %.
    sigma = sigmas(FilterSettings())[HOURS[1:] * 360 - 1, GYRO_BIAS_Z]
    T, white = HOURS[1:] * 3600.0, FilterSettings().gyro_white
    level = earth.EARTH_RATE * np.cos(LATITUDE)
    closed = white * np.sqrt(12 / (level**2 * T**3) + 6 / (5 * T))
    np.testing.assert_allclose(sigma, closed, rtol=0.02)


def test_a_step_is_the_exponential_of_the_dynamics_of_its_motion():
    motion, theta = model.VehicleMotion(0.7, 8.0, -6.0, 0.1, -0.2), 0.6
    settings = FilterSettings(interval=1.0)
    velocity = np.array([[7.95, 8.05], [-5.9, -6.1]])  # m/s, at the edges of a second
    built = build_filter_model(
        np.full(2, theta), velocity, np.full(2, 0.7), 1.0, settings, np.array([1])
    )
    Phi = expm(model.srins_error_dynamics(motion, settings.damping, theta))
    at_rest = expm(model.srins_error_dynamics(model.VehicleMotion(0.7), settings.damping, theta))
    size = np.abs(Phi).max(axis=1, keepdims=True)
    assert (np.abs(Phi - at_rest) / size).max() > 1e-3
    np.testing.assert_allclose(built.Phi[0] / size, Phi / size, atol=1e-9)
    # White noise through the dynamics by trapezoids.
    noise = settings.process_noise()
    expected = 0.5 * noise + 0.5 * Phi @ noise @ Phi.T
    moving = np.setdiff1d(np.arange(16), np.arange(7, 12))  # not the sensors' constant errors
    sigma = np.sqrt(np.diag(expected)[moving])
    np.testing.assert_allclose(
        built.Q[0][np.ix_(moving, moving)] / np.outer(sigma, sigma),
        expected[np.ix_(moving, moving)] / np.outer(sigma, sigma),
        atol=1e-9,
    )
    assert not np.any(built.Q[0][7:12])
    np.testing.assert_allclose(built.H[0, :4], model.measurement_matrix(damping_states=False))


def test_the_length_of_the_filter_step_does_not_matter():
    short = sigmas(FilterSettings(interval=2.0), hours=2.0)[-1, :12]
    default = sigmas(FilterSettings(interval=10.0), hours=2.0)[-1, :12]
    # The mean over a step blurs the turning, 60 deg in ten seconds: the accelerometers lose 2 %.
    np.testing.assert_allclose(default, short, rtol=0.02)
    assert default[GYRO_BIAS_Z] == pytest.approx(short[GYRO_BIAS_Z], rel=1e-3)


def test_two_stops_separate_the_level_drifts_sooner():
    one, two = (sigmas(FilterSettings(), kind=kind)[-1] for kind in ("one-stop", "two-stop"))
    assert two[GYRO_BIAS_Z] == pytest.approx(
        one[GYRO_BIAS_Z], rel=0.01
    )  # the axial drift does not care
    assert two[7] < one[7]


def test_errors_of_a_hundred_runs_agree_with_the_filters_covariance():
    settings = FilterSettings(interval=10.0)
    hours, runs = 3.0, 120
    steps = steps_of(settings, hours)
    P0 = np.diag(settings.initial_sigma(LATITUDE) ** 2)
    gains = gain_sequence(steps, P0)
    rng = np.random.default_rng(1)
    truth, z = simulate_linear(steps, settings, P0, rng, runs, hours)
    estimates, innovations = run_filter(steps, gains, z)
    error = estimates[-1] - truth
    nees = np.einsum("ir,ir->r", error, np.linalg.solve(gains.covariance, error))
    low, high = chi2.ppf([0.025, 0.975], 16 * runs) / runs
    assert low < nees.mean() < high
    axial = np.square(error[GYRO_BIAS_Z] / gains.sigma[-1, GYRO_BIAS_Z])
    low, high = chi2.ppf([0.025, 0.975], runs) / runs
    assert low < axial.mean() < high
    nis = np.einsum("kir,kir->kr", innovations, np.linalg.solve(gains.S, innovations))
    # 1080 steps of 8 numbers in 120 runs: the band is 0.2 %; 2 % for the mean within a step.
    assert nis.mean() == pytest.approx(8.0, rel=0.02)


def simulate_linear(steps, settings, P0, rng, runs, hours):
    """Return the true states (16, runs) at the end and the measurements (m, 8, runs).

    The truth moves in steps of 1 s, with noise of its own; the filter's steps are 10 s.
    """
    one = FilterSettings(**{**vars(settings), "interval": 1.0})
    fine = steps_of(one, hours)
    x = np.sqrt(P0) @ rng.standard_normal((16, runs))
    white = np.sqrt(np.diag([settings.accel_white**2] * 2 + [settings.gyro_white**2] * 3))
    G = settings.reference_white * model.reference_input(settings.damping)
    sigma = np.sqrt(settings.measurement_noise(LATITUDE)[:4])[:, None]
    z = np.zeros((len(steps.Phi), 8, runs))
    for k in range(len(fine.Phi)):
        x = fine.Phi[k] @ x
        x[:5] += white @ rng.standard_normal((5, runs))
        x += G @ rng.standard_normal((2, runs))
        z[k // 10, :4] += 0.1 * (x[[0, 1, 5, 6]] + sigma * rng.standard_normal((4, runs)))
        z[k // 10, 4:] = x[12:] + 1e-6 * rng.standard_normal((4, runs))
    return x, z
