"""Running the zero-velocity filter: mechanize the sensor frame, update, feed back.

Everything that needs no data is in `rotcli.models.zero_velocity`; many runs of one table motion go
through here together.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rotcli.models import kalman, zero_velocity
from rotcli.models.increments import Blocks, integrate
from rotcli.models.rotation import (
    axis_rotation,
    euler_angles,
    matrix_from_quaternion,
    quaternion_from_vector,
    skew,
)
from rotcli.models.zero_velocity import EPS, Plan, Settings, V, fill_transition
from rotcli.units import DEG, wrap_pi

Array = NDArray[np.float64]

# rad: a table standing so far from its given attitude has the filter planned anew about the one it
# stands at: the transitions are right to first order only (2 deg: 0.2 deg of azimuth).
FAR_OFF = 0.3 * DEG
CLEAR = 4.0  # sigmas by which a tilt must show before it is believed


@dataclass(frozen=True, eq=False)
class Estimates:
    """State history of `runs` logs over n updates, SI.

    time: (n,) s after the first sample. values: (runs, n, m): what is estimated for `states`; the
    velocity of the axis, the turn of the table from its given attitude (tilts in n, azimuth
    clockwise), the sensor biases, the lever arm across the axis. sigma: (n, m), or
    (runs, n, m) without slaving. attitude_errors: (runs, n, 3) pitch, roll, azimuth against the
    given attitude. nis: (runs, n). P: final covariance.
    """

    states: tuple[str, ...]
    time: Array
    values: Array
    sigma: Array
    attitude_errors: Array
    nis: Array
    P: Array


# What a state's estimated error adds to the value shown for it: errors of velocity and tilt are
# computed minus true; azimuth counts clockwise; biases and lever arm are true minus estimated.
SIGNS = np.array([-1.0] * 5 + [1.0] * 12)


def run(plan: Plan, gyro: Array, accel: Array) -> Estimates:
    """Run the filter over logs of one table motion.

    gyro (rad/s), accel (m/s^2): (runs, n, 3), or (n, 3) for one run, in s.
    Smoothing needs the slaved azimuth: without it there is no gain sequence to go back through.
    """
    s, gains = plan.settings, plan.gains
    gyro, accel = (a[None] if a.ndim == 2 else a for a in (gyro, accel))
    values, corrections, innovations, P, S = _loop(plan, gyro, accel)
    signs = SIGNS[: values.shape[-1]]
    if s.smooth and s.slave_azimuth:
        added, P = kalman.smoother_corrections(gains, corrections)
        values = values + signs * added
    values[..., 5] = wrap_pi(values[..., 5])
    sigma = np.sqrt(np.diagonal(P, axis1=-2, axis2=-1))
    nis = kalman.normalized_squares(innovations, S if S.ndim == 4 else S[:, None])
    values = np.swapaxes(values, 0, 1)
    return Estimates(
        states=s.states,
        time=plan.interval * s.samples * np.arange(1, values.shape[1] + 1),
        values=values,
        sigma=sigma if sigma.ndim == 2 else np.swapaxes(sigma, 0, 1),
        attitude_errors=attitude_errors(s.C_nb, values[..., EPS]),
        nis=nis.T,
        P=P[-1],
    )


def attitude_errors(C_nb: Array, turn: Array) -> Array:
    """Return errors of pitch, roll, azimuth (..., 3), rad, of a body turned away from C_nb.

    turn: (..., 3) tilts about east and north, azimuth clockwise, rad.
    """
    tilt = np.moveaxis(np.append(turn[..., :2], np.zeros_like(turn[..., :1]), axis=-1), -1, 0)
    C_tilt = matrix_from_quaternion(quaternion_from_vector(tilt))
    C_hat = axis_rotation(np.array([0.0, 0.0, 1.0]), -turn[..., 2]) @ C_tilt @ C_nb
    pairs = zip(euler_angles(C_hat), euler_angles(C_nb), strict=True)
    return np.stack([wrap_pi(estimated - given) for estimated, given in pairs], axis=-1)


def clear_tilt(estimates: Estimates) -> Array | None:
    """Return the first run's tilts (2,) about east and north, rad, where large and sure at the end.

    None where the table stands as given, to within FAR_OFF or CLEAR sigmas.
    """
    tilt: Array = estimates.values[0, -1, 3:5]
    size = float(np.hypot(*tilt))
    sigma = float(np.hypot(*np.atleast_3d(estimates.sigma.T).T[0, -1, 3:5]))
    return tilt if size > max(FAR_OFF, CLEAR * sigma) else None


def as_it_stands(
    settings: Settings, off: Array, theta: Array, interval: float, gyro: Array, accel: Array
) -> tuple[Settings, Estimates]:
    """Filter once more about the attitude that a first pass found.

    off: (2,) rad, its tilts about east and north. Returns the settings about that attitude, and
    estimates whose tilts and attitude errors still count from the attitude given.
    """
    size = float(np.hypot(*off))
    turn = axis_rotation(np.array([*off, 0.0]) / size, size)
    found = replace(settings, C_nb=turn @ settings.C_nb)
    estimates = run(zero_velocity.plan(theta, interval, found), gyro, accel)
    values = estimates.values.copy()
    values[..., 3:5] += off
    errors = attitude_errors(settings.C_nb, values[..., EPS])
    return found, replace(estimates, values=values, attitude_errors=errors)


def advance(
    plan: Plan, blocks: Blocks, k: int, C_ns: Array, v_n: Array, held: Array
) -> tuple[Array, Array]:
    """Mechanize block k of all runs: attitude (runs, 3, 3) and velocity (runs, 3) after it.

    held: (runs, m - 6) what is known of the states from the biases on, and taken out.
    Nonlinear: v' = C_ns f + g - 2 w_ie x v, C_ns' = C_ns [w_is_s x] - [w_ie_n x] C_ns.
    """
    b_a, b_g = held[:, 0:3, None], held[:, 3:6, None]
    if plan.settings.initial.scale:
        column = plan.settings.column_states.start - 6
        b_g = b_g + plan.rate[k] * held[:, column:, None]
    lever, one = blocks.lever[k], np.eye(3)
    dv = blocks.velocity[k, :, :, None] - lever @ b_a + blocks.sway[k] @ b_g
    dv_n = 0.5 * (one + plan.earth) @ C_ns @ dv
    v_n = v_n @ plan.fall.T + dv_n[:, :, 0] + plan.weight
    return plan.earth @ C_ns @ _turn((lever @ -b_g)[:, :, 0]) @ blocks.turn[k], v_n


def _turn(phi: Array) -> Array:
    """Return the rotation matrices (runs, 3, 3) of rotation vectors (runs, 3), rad (Rodrigues)."""
    X = skew(phi)
    angle = np.sqrt((phi * phi).sum(axis=-1))[:, None, None]
    half = np.sinc(angle / (2.0 * np.pi))
    result: Array = np.eye(3) + np.sinc(angle / np.pi) * X + 0.5 * half * half * (X @ X)
    return result


def _loop(plan: Plan, gyro: Array, accel: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Mechanize and update; return values, corrections, innovations (n, runs, ...), P and S."""
    s, gains, tau = plan.settings, plan.gains, plan.interval * plan.settings.samples
    blocks = integrate(gyro, accel, plan.interval, s.samples, s.averages)
    n, runs, m = len(gains.K), len(gyro), len(s.states)
    values, corrections = np.empty((n, runs, m)), np.empty((n, runs, m))
    innovations = np.empty((n, runs, 3))
    P_all, S_all = gains.posterior, gains.S
    if not s.slave_azimuth:  # the gains depend on the computed attitude: run by run
        P_all, S_all = np.empty((n, runs, m, m)), np.empty((n, runs, 3, 3))
        P, Phi = np.broadcast_to(plan.P0, (runs, m, m)), np.tile(np.eye(m), (runs, 1, 1))
        R = np.eye(3) * s.velocity_sigma**2

    one = np.eye(3)
    C_sb_n = np.swapaxes(s.C_nb @ plan.C_bs, -1, -2)  # (n + 1, 3, 3), from n to s at the table

    C = np.broadcast_to(s.C_nb @ plan.C_bs[0], (runs, 3, 3))
    v = np.broadcast_to(plan.arm[0], (runs, 3))
    held = np.zeros((runs, m - 6))  # biases, lever arm
    psi = np.zeros(runs)
    for k in range(n):
        if not s.slave_azimuth:
            fill_transition(Phi, C @ blocks.lever[k], C @ blocks.remaining[k], s, tau)
            K, S_all[k], P = kalman.update(kalman.predict(P, Phi, plan.Q), plan.H[k + 1], R)
            P_all[k] = P
        C, v = advance(plan, blocks, k, C, v, held)
        z = v - plan.arm[k + 1] - held[:, 6:] @ plan.H[k + 1, :, 12:].T
        x = z @ gains.K[k].T if s.slave_azimuth else (K @ z[:, :, None])[:, :, 0]
        v = v - x[:, V]
        held = held + x[:, 6:]
        eps = x[:, EPS].copy()
        if s.slave_azimuth:
            psi = psi - eps[:, 2]
            eps[:, 2] = 0.0
        C = _turn(-eps) @ C
        if k % 10 == 0:  # keep it orthonormal: one Newton step towards the nearest rotation
            C = 0.5 * C @ (3.0 * one - np.swapaxes(C, -1, -2) @ C)
        M = C @ C_sb_n[k + 1]  # the computed attitude against the given one, in n
        up = np.arctan2(M[:, 1, 0] - M[:, 0, 1], M[:, 0, 0] + M[:, 1, 1])
        if s.slave_azimuth:
            back = axis_rotation(np.array([0.0, 0.0, 1.0]), -up)
            C, v = back @ C, (back @ v[:, :, None])[:, :, 0]
            M = back @ M
            psi = psi + up
            up = psi
        values[k, :, V] = v - plan.arm[k + 1] - held[:, 6:] @ plan.H[k + 1, :, 12:].T
        values[k, :, 3] = 0.5 * (M[:, 2, 1] - M[:, 1, 2])
        values[k, :, 4] = 0.5 * (M[:, 0, 2] - M[:, 2, 0])
        values[k, :, 5] = -up
        values[k, :, 6:] = held
        corrections[k], innovations[k] = x, z
    return values, corrections, innovations, P_all, S_all
