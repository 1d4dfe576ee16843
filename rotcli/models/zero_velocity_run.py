"""Running the zero-velocity filter: mechanize the sensor frame, update, feed back.

A log goes through part by part; what one part leaves to the next is kept in `Filter`, so that the
parts together are the whole log filtered at once. What needs no data is in
`rotcli.models.zero_velocity`.

The computed attitude is held as the turn M of the computed frame against the given one,
`C_ns = M C_nb C_bs(theta)`: near the identity, and everything that a sample does to it but for
the biases is worked out for all updates together.
"""

from dataclasses import dataclass, replace
from math import atan2, hypot, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from rotcli.models import kalman
from rotcli.models.earth import EARTH_RATE, earth_rate_n
from rotcli.models.errors_ins import coriolis
from rotcli.models.increments import preintegrate
from rotcli.models.kalman import Gains, Later
from rotcli.models.rotation import (
    axis_rotation,
    euler_angles,
    matrix_from_quaternion,
    quaternion_from_vector,
    skew,
)
from rotcli.models.zero_velocity import BG, EPS, Plan, Settings, V, fill_transition
from rotcli.units import DEG, wrap_pi

Array = NDArray[np.float64]

# rad: a table standing so far from its given attitude has the filter planned anew about the one it
# stands at: the transitions are right to first order only (2 deg: 0.2 deg of azimuth).
FAR_OFF = 0.3 * DEG
CLEAR = 4.0  # sigmas by which a tilt must show before it is believed

_ONE = np.eye(3)
_SKEW = skew(_ONE).reshape(3, 9)  # phi @ _SKEW holds the elements of skew(phi)
_LEVEL = np.array([1.0, 1.0, 0.0])


@dataclass(frozen=True, eq=False)
class Estimates:
    """What n updates that follow one another estimate, SI.

    C_nb: (3, 3) the attitude that the turns count from. time: (n,) s, from the first sample of the
    log. values: (n, m): what is estimated for `states`; the velocity of the axis, the turn of the
    table from its given attitude (tilts in n, azimuth clockwise), the sensor biases, the lever
    arm across the axis. sigma: (n, m). nis: (n,). P: (m, m) covariance after the last of them.
    """

    states: tuple[str, ...]
    C_nb: Array
    time: Array
    values: Array
    sigma: Array
    nis: Array
    P: Array

    @property
    def attitude_errors(self) -> Array:
        """Errors of pitch, roll, azimuth (n, 3) against the given attitude, rad."""
        return attitude_errors(self.C_nb, self.values[:, EPS])


@dataclass(frozen=True, eq=False)
class Part:
    """Updates that were filtered. before: (m, m) covariance before the first of them.

    corrections: (n, m) what each update added to the state.
    """

    estimates: Estimates
    before: Array
    corrections: Array


# What a state's estimated error adds to the value shown for it: errors of velocity and tilt are
# computed minus true; azimuth counts clockwise; biases and lever arm are true minus estimated.
SIGNS = np.array([-1.0] * 5 + [1.0] * 12)


def attitude_errors(C_nb: Array, turn: Array) -> Array:
    """Return errors of pitch, roll, azimuth (..., 3), rad, of a body turned away from C_nb.

    turn: (..., 3) tilts about east and north, azimuth clockwise, rad.
    """
    tilt = np.moveaxis(np.append(turn[..., :2], np.zeros_like(turn[..., :1]), axis=-1), -1, 0)
    C_tilt = matrix_from_quaternion(quaternion_from_vector(tilt))
    C_hat = axis_rotation(np.array([0.0, 0.0, 1.0]), -turn[..., 2]) @ C_tilt @ C_nb
    pairs = zip(euler_angles(C_hat), euler_angles(C_nb), strict=True)
    return np.stack([wrap_pi(estimated - given) for estimated, given in pairs], axis=-1)


def clear_tilt(last: Estimates) -> Array | None:
    """Return the tilts (2,) about east and north, rad, where they are large and sure at the end.

    None where the table stands as given, to within FAR_OFF or CLEAR sigmas.
    """
    tilt: Array = last.values[-1, 3:5]
    size = float(np.hypot(*tilt))
    sigma = float(np.hypot(*last.sigma[-1, 3:5]))
    return tilt if size > max(FAR_OFF, CLEAR * sigma) else None


def turned(C_nb: Array, off: Array) -> Array:
    """Return the attitude (3, 3) of a table that tilts by off (2,), rad, about east and north."""
    size = float(np.hypot(*off))
    result: Array = axis_rotation(np.array([*off, 0.0]) / size, size) @ C_nb
    return result


@dataclass(frozen=True, eq=False)
class Mechanics:
    """What the sensors read over n updates, seen in the given frame n.

    push: (n, 3) m/s, integral of the specific force. drift: (n, 3, 3) the sensors' turn against
    the table's, near the identity. feel: (n, 6, m - 6) what each of the states from the biases
    on changes in velocity and rotation vector. lever, remaining: (n, 3, 3), the integrals of
    `PreintegratedBlocks`.
    earth: (6, 3) Earth rate's turn of the frame over an update, and its mean over it; fall (3, 3),
    weight (3,): what Coriolis and gravity do to the velocity.
    """

    push: Array
    drift: Array
    feel: Array
    lever: Array
    remaining: Array
    earth: Array
    fall: Array
    weight: Array


def mechanics(plan: Plan, gyro: Array, accel: Array) -> Mechanics:
    """Integrate a log, gyro (rad/s) and accel (m/s^2) (n, 3), between the updates planned."""
    s, tau = plan.settings, plan.tau
    blocks = preintegrate(gyro[None], accel[None], plan.interval, s.samples, s.averages)
    C_ns = s.C_nb @ plan.C_bs  # the given one, at the start and at each update
    lever, sway = (
        C_ns[:-1] @ blocks.rotation_integral[:, 0],
        C_ns[:-1] @ blocks.dv_gyro_bias_jacobian[:, 0],
    )
    feel = np.zeros((len(lever), 6, len(s.states) - 6))
    feel[:, :3, 0:3], feel[:, :3, 3:6], feel[:, 3:, 3:6] = -lever, sway, -lever
    if s.initial.scale:  # N u at the interval's mean rate is a gyro bias
        column = s.column_states.start - 6
        feel[:, :, column:] = plan.rate[:, None, None] * feel[:, :, 3:6]
    w_ie_n = earth_rate_n(s.latitude)
    earth = axis_rotation(w_ie_n / EARTH_RATE, -EARTH_RATE * tau)
    return Mechanics(
        push=(C_ns[:-1] @ blocks.dv[:, 0, :, None])[:, :, 0],
        drift=C_ns[:-1] @ blocks.C_start_end[:, 0] @ np.swapaxes(C_ns[1:], -1, -2),
        feel=feel,
        lever=lever,
        remaining=C_ns[:-1] @ blocks.rotation_double_integral[:, 0],
        earth=np.concatenate([earth, 0.5 * (_ONE + earth)]),
        fall=_ONE + coriolis(s.latitude) * tau,
        weight=np.array([0.0, 0.0, -s.gravity * tau]),
    )


def advance(way: Mechanics, k: int, M: Array, v_n: Array, held: Array) -> tuple[Array, Array]:
    """Mechanize to update k: the frame's turn M (3, 3) and velocity (3,) just before it.

    held: (m - 6,) what is known of the states from the biases on, and taken out.
    Nonlinear: v' = C_ns f + g - 2 w_ie x v, C_ns' = C_ns [w_is_s x] - [w_ie_n x] C_ns.
    """
    known = way.feel[k].dot(held)
    frames = way.earth.dot(M)
    v_n = way.fall.dot(v_n) + frames[3:].dot(way.push[k] + known[:3]) + way.weight
    return frames[:3].dot(_turn(known[3:])).dot(way.drift[k]), v_n


def _turn(phi: Array) -> Array:
    """Return the rotation matrix (3, 3) of a rotation vector (3,), rad (Rodrigues)."""
    X = phi.dot(_SKEW).reshape(3, 3)
    angle = sqrt(phi.dot(phi))
    along, across = (sin(angle) / angle, sin(0.5 * angle) / angle) if angle else (1.0, 0.5)
    result: Array = X.dot(X)
    result *= 2.0 * across * across
    result += along * X
    result += _ONE
    return result


class Filter:
    """The filter on its way through a log, part by part: what one part leaves to the next."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.done = 0  # updates
        self._P: Array | None = None  # (m, m)
        self._M, self._v = _ONE, np.zeros(3)
        self._held = np.zeros(len(settings.states) - 6)  # biases, lever arm, column N u
        self._psi = 0.0  # rad

    def advance(self, plan: Plan, gyro: Array, accel: Array, gains: Gains | None = None) -> Part:
        """Filter the part of a log that follows.

        gyro (rad/s), accel (m/s^2): (n samples + 1, 3), in s; the first is the sample of the last
        update, or of the log's start. gains: of the plan, where they are known.
        """
        s = self.settings
        before = plan.P0 if self._P is None else self._P
        if not self.done:
            self._v = plan.arm[0]
        if gains is None and s.slave_azimuth:
            gains = plan.gains(before)
        way = mechanics(plan, gyro, accel)
        values, corrections, innovations, gains = self._loop(plan, way, gains, before)
        n = len(values)
        time: Array = plan.tau * np.arange(self.done + 1.0, self.done + n + 1.0)
        values[:, 5] = wrap_pi(values[:, 5])
        estimates = Estimates(
            states=s.states,
            C_nb=s.C_nb,
            time=time,
            values=values,
            sigma=np.sqrt(np.diagonal(gains.posterior, axis1=-2, axis2=-1)),
            nis=kalman.normalized_squares(innovations, gains.S),
            P=gains.posterior[-1].copy(),
        )
        self.done, self._P = self.done + n, estimates.P
        return Part(estimates, before, corrections)

    def _loop(
        self, plan: Plan, way: Mechanics, gains: Gains | None, P: Array
    ) -> tuple[Array, Array, Array, Gains]:
        """Mechanize and update; return values, corrections, innovations (n, ...) and the gains."""
        s, n, m = self.settings, len(plan.rate), len(self.settings.states)
        values, corrections, innovations = np.empty((n, m)), np.empty((n, m)), np.empty((n, 3))
        turns, azimuth = np.empty((n, 3, 3)), np.empty(n)
        slaved = gains is not None
        if gains is None:  # they depend on the computed attitude: found on the way
            K, S, prior = np.empty((n, m, 3)), np.empty((n, 3, 3)), np.empty((n, m, m))
            gains = Gains(plan.Phi.copy(), K, S, prior, np.empty((n, m, m)))
        lever, at = s.lever_states, slice(s.lever_states.start - 6, s.lever_states.stop - 6)
        arms = plan.H[1:, :, lever] if s.estimate_lever_arm else None
        fed_back = -_LEVEL if slaved else -np.ones(3)
        M, v, held = self._M, self._v, self._held
        for k in range(n):
            if not slaved:
                Phi = gains.Phi[k]
                fill_transition(Phi, M @ way.lever[k], M @ way.remaining[k], s, plan.tau)
                Phi[:6, s.column_states] = plan.rate[k] * Phi[:6, BG] if s.initial.scale else 0.0
                gains.prior[k] = kalman.predict(P, Phi, plan.Q)
                gains.K[k], gains.S[k], P = kalman.update(gains.prior[k], plan.H[k + 1], plan.R)
                gains.posterior[k] = P
            M, v = advance(way, k, M, v, held)
            z = v - plan.arm[k + 1]
            if arms is not None:
                z -= arms[k].dot(held[at])
            innovations[k] = z
            x = gains.K[k].dot(z, out=corrections[k])
            v = v - x[V]
            held = held + x[6:]
            M = _turn(fed_back * x[EPS]).dot(M)
            if (self.done + k) % 10 == 0:  # one Newton step towards the nearest rotation
                M = 0.5 * M.dot(3.0 * _ONE - M.T.dot(M))
            (a, b, _), (c, d, _), _ = M.tolist()
            azimuth[k] = atan2(c - b, a + d)
            if slaved:  # turned back to the table's azimuth
                size = hypot(c - b, a + d)
                cos, sine = (a + d) / size, (c - b) / size
                back = np.array([[cos, sine, 0.0], [-sine, cos, 0.0], [0.0, 0.0, 1.0]])
                M, v = back.dot(M), back.dot(v)
            turns[k], values[k, V], values[k, 6:] = M, v, held
        self._M, self._v, self._held = M, v, held
        if slaved:
            azimuth = np.cumsum(np.append(self._psi, azimuth - corrections[:, 5]))[1:]
            self._psi = float(azimuth[-1])
        values[:, V] -= plan.arm[1:]
        if arms is not None:
            values[:, V] -= np.einsum("kij,kj->ki", arms, values[:, lever])
        values[:, 3] = 0.5 * (turns[:, 2, 1] - turns[:, 1, 2])
        values[:, 4] = 0.5 * (turns[:, 0, 2] - turns[:, 2, 0])
        values[:, 5] = -azimuth
        return values, corrections, innovations, gains


def smoothed(plan: Plan, part: Part, later: Later | None = None) -> tuple[Estimates, Later]:
    """Return a part of the slaved filter smoothed, and what the part before it needs for it.

    later: what was returned for the part that follows; None for the last.
    """
    gains = plan.gains(part.before)
    added, P, first = kalman.smoother_corrections(gains, part.corrections, later)
    values = part.estimates.values + SIGNS[: added.shape[-1]] * added
    values[:, 5] = wrap_pi(values[:, 5])
    sigma = np.sqrt(np.diagonal(P, axis1=-2, axis2=-1))
    return replace(part.estimates, values=values, sigma=sigma, P=P[-1].copy()), first


def run(plan: Plan, gyro: Array, accel: Array, gains: Gains | None = None) -> Estimates:
    """Filter a log in one go, smoothed where the settings say so.

    gyro (rad/s), accel (m/s^2): (n, 3), in s. gains: those of the plan, where they are known.
    Smoothing needs the slaved azimuth: without it there is no gain sequence to go back through.
    """
    s = plan.settings
    part = Filter(s).advance(plan, gyro, accel, gains)
    return smoothed(plan, part)[0] if s.smooth and s.slave_azimuth else part.estimates
