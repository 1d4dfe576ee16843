"""The linear error dynamics against a perturbed nonlinear mechanization."""

import numpy as np
import pytest

from rotcli.models.earth import earth_rate_n
from rotcli.models.rotation import attitude_matrix, euler_angles, skew
from rotcli.observe.errors_ins import (
    STATES_IN_N,
    STATES_IN_S,
    euler_errors,
    velocity_measurement,
    zupt_error_dynamics,
)
from rotcli.observe.observability_matrix import natural_units, scaled_observability_matrix
from rotcli.units import DEG

LATITUDE = 51.0 * DEG


def error_rate(x, latitude, gravity, acceleration_n, w_ns_n, C_ns):
    """Return x' of errors x (12,) by mechanizing perturbed and true state side by side.

    v' = C_ns f + g - 2 w_ie x v and C_ns' = C_ns [w_is_s x] - [w_ie_n x] C_ns.
    """
    w_ie = earth_rate_n(latitude)
    gravity_n = np.array([0.0, 0.0, -gravity])
    v = np.array([0.4, -0.3, 0.2])
    w_is_s = C_ns.T @ (w_ns_n + w_ie)
    f_s = C_ns.T @ (acceleration_n - gravity_n + 2.0 * np.cross(w_ie, v))
    dv, eps = x[:3], x[3:6]
    b_a, b_g = C_ns.T @ x[6:9], C_ns.T @ x[9:]

    def mechanize(v, C, gyro, accel):
        return C @ accel + gravity_n - 2.0 * np.cross(w_ie, v), C @ skew_c(gyro) - skew(w_ie) @ C

    C_hat = (np.eye(3) + skew_c(eps)) @ C_ns
    v_dot, C_dot = mechanize(v, C_ns, w_is_s, f_s)
    v_hat_dot, C_hat_dot = mechanize(v + dv, C_hat, w_is_s + b_g, f_s + b_a)
    # [eps x] = C_hat C^T - I, so its rate is C_hat' C^T + C_hat C'^T.
    E = C_hat_dot @ C_ns.T + C_hat @ C_dot.T
    eps_dot = 0.5 * np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]])
    w_ns_s = skew_c(C_ns.T @ w_ns_n)  # constant biases, turning axes: gamma' = C_ns' b_a
    return np.concatenate([v_hat_dot - v_dot, eps_dot, C_ns @ w_ns_s @ b_a, C_ns @ w_ns_s @ b_g])


def skew_c(v):
    """The cross product matrix, of complex vectors too."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


@pytest.mark.parametrize("acceleration", [(0.0, 0.0, 0.0), (1.5, -0.7, 0.3)])
@pytest.mark.parametrize("rate", [0.0, 10.0, -100.0])
def test_f_is_the_derivative_of_the_nonlinear_mechanization(acceleration, rate):
    C_ns = attitude_matrix(0.4, -1.1, 2.2)
    w_ns_n = rate * DEG * C_ns @ np.array([0.36, -0.48, 0.8])
    acceleration = np.array(acceleration)
    f_n = acceleration + np.array([0.0, 0.0, 9.81])
    F = zupt_error_dynamics(LATITUDE, f_n, w_ns_n, "full")
    h = 1e-30  # complex step: no difference is taken, so no digit is lost
    measured = np.empty((12, 12))
    for j in range(12):
        x = np.zeros(12, dtype=complex)
        x[j] = 1j * h
        measured[:, j] = error_rate(x, LATITUDE, 9.81, acceleration, w_ns_n, C_ns).imag / h
    # The force of the moving table contains the Coriolis term 2 w_ie x v of 0.5 m/s, which F leaves
    # out of its own f_n: 7e-5 m/s^2. All else agrees to rounding.
    coriolis = 2.0 * np.cross(earth_rate_n(LATITUDE), [0.4, -0.3, 0.2])
    F[:3, 3:6] -= skew(coriolis)
    np.testing.assert_allclose(F, measured, atol=1e-13)
    assert np.abs(F).max() > 9.0


def test_the_simplified_model_differs_by_earth_rate_in_the_attitude_only():
    f_n, w = np.array([0.0, 0.0, 9.8]), np.array([0.0, 0.1, 0.0])
    difference = zupt_error_dynamics(LATITUDE, f_n, w, "full") - zupt_error_dynamics(
        LATITUDE, f_n, w
    )
    np.testing.assert_array_equal(difference[3:6, 3:6], -skew(earth_rate_n(LATITUDE)))
    difference[3:6, 3:6] = 0.0
    assert not difference.any()


@pytest.mark.parametrize(
    ("pitch", "roll", "azimuth"), [(0.0, 0.0, 0.0), (0.5, 0.3, 2.0), (-1.0, 2.5, -1)]
)
def test_euler_errors_are_those_of_a_perturbed_attitude(pitch, roll, azimuth):
    C_nb = attitude_matrix(pitch, roll, azimuth)
    for eps in np.eye(3) * 1e-6:
        up = euler_angles((np.eye(3) + skew(eps)) @ C_nb)
        down = euler_angles((np.eye(3) - skew(eps)) @ C_nb)
        central = np.subtract(up, down) / 2e-6
        # Central differences of a smooth function: error of order step squared.
        np.testing.assert_allclose(euler_errors(eps * 1e6, pitch, azimuth), central, atol=1e-8)


def test_natural_units_make_the_observability_matrix_free_of_units():
    axis = np.array([0.0, 0.6, 0.8])
    singular = []
    for rate, gravity in ((0.01, 9.8), (3.0, 1.6)):
        F = zupt_error_dynamics(0.0, np.array([0.0, 0.0, gravity]), rate * axis)
        F[:3, :3] = 0.0  # Coriolis: the one term with a rate of its own
        Q = scaled_observability_matrix(F, velocity_measurement(), *natural_units(gravity, rate))
        assert Q.shape == (36, 12)
        singular.append(np.linalg.svd(Q, compute_uv=False))
    np.testing.assert_allclose(singular[0], singular[1], atol=1e-12)


def test_states_have_names_in_both_frames():
    assert len(set(STATES_IN_N)) == len(set(STATES_IN_S)) == 12
    assert STATES_IN_N[:6] == STATES_IN_S[:6]
