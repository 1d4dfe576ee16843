"""The updates of the ZUPT filter: mechanization from update to update, correction, feedback.

The computed attitude is stored as the rotation C_error of the computed frame relative to the
nominal one, `C_ns = C_error C_nb C_bs(theta)`: it is near the identity, and everything that a
sample adds to it except for the biases is computed for all updates together.

`filter_updates` takes one update after the other. It is needed where the gains depend on the data
(free azimuth) and serves as the reference of `rotcli.observe.zupt.newton`, which solves all updates
of the slaved filter together.
"""

from math import atan2, hypot, sin, sqrt

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models import kalman
from rotcli.models.earth import EARTH_RATE, earth_rate_n
from rotcli.models.kalman import FilterGains, Gains
from rotcli.models.rotation import axis_rotation, skew
from rotcli.observe.errors_ins import coriolis
from rotcli.observe.zupt.increments import preintegrate
from rotcli.observe.zupt.model import (
    ACCEL_BIAS,
    ATTITUDE,
    ESTIMATED,
    GYRO_BIAS,
    MECHANIZED,
    VELOCITY,
    UpdateModel,
    fill_transition,
)
from rotcli.units import FloatArray

_UPDATES_PER_ORTHOGONALIZATION = 10  # rounding of 10 products is 1e-15: one Newton step suffices

_ONE = np.eye(3)
_SKEW = skew(_ONE).reshape(3, 9)  # phi @ _SKEW contains the elements of skew(phi)
LEVEL = np.array([1.0, 1.0, 0.0])


def among_estimated(group: slice) -> slice:
    """Return the slice of a group of states within the estimated states alone."""
    return slice(group.start - ESTIMATED.start, group.stop - ESTIMATED.start)


_ACCEL, _GYRO = among_estimated(ACCEL_BIAS), among_estimated(GYRO_BIAS)


@dataclass(frozen=True, eq=False)
class UpdateIncrements:
    """The sensors' increments over n updates, in the nominal frame n.

    dv_n: (n, 3) m/s, integral of the specific force. relative_rotation: (n, 3, 3) of the sensors
    relative to the table, near the identity. bias_jacobian: (n, 6, m - 6), change of velocity and
    rotation vector per estimated state (biases, lever arm, axis column). rotation_integral,
    rotation_double_integral: (n, 3, 3) as in `PreintegratedBlocks`. earth_rotation: (6, 3), of the
    frame by Earth rate over an update, and its mean over it. coriolis_matrix (3, 3), gravity_dv
    (3,): effect of Coriolis and gravity on the velocity.
    """

    dv_n: FloatArray
    relative_rotation: FloatArray
    bias_jacobian: FloatArray
    rotation_integral: FloatArray
    rotation_double_integral: FloatArray
    earth_rotation: FloatArray
    coriolis_matrix: FloatArray
    gravity_dv: FloatArray


@dataclass(frozen=True, eq=False)
class FilterState:
    """The nonlinear state of the filter after an update.

    C_error: (3, 3). velocity: (3,) m/s. bias_estimates: (m - 6,). updates: number of them so far.
    """

    C_error: FloatArray
    velocity: FloatArray
    bias_estimates: FloatArray
    updates: int = 0


@dataclass(frozen=True, eq=False)
class UpdateResults:
    """The results of n updates.

    C_error: (n, 3, 3), velocity: (n, 3), bias_estimates: (n, m - 6) after each update.
    azimuth: (n,) rad, of the computed frame before it is rotated back. corrections: (n, m).
    innovations: (n, 3) m/s.
    """

    C_error: FloatArray
    velocity: FloatArray
    bias_estimates: FloatArray
    azimuth: FloatArray
    corrections: FloatArray
    innovations: FloatArray

    def last(self, updates: int) -> FilterState:
        """Return the state after the last update; updates: number of those before the first."""
        return FilterState(
            self.C_error[-1],
            self.velocity[-1],
            self.bias_estimates[-1],
            updates + len(self.velocity),
        )

    def join(self, later: "UpdateResults") -> "UpdateResults":
        """Return these results and those of the updates that follow, as one."""
        names = tuple(self.__dataclass_fields__)
        return UpdateResults(
            **{n: np.concatenate([getattr(self, n), getattr(later, n)]) for n in names}
        )


def preintegrate_updates(
    model: UpdateModel, gyro: FloatArray, accel: FloatArray
) -> UpdateIncrements:
    """Integrate a log, gyro (rad/s) and accel (m/s^2) (n, 3), from update to update."""
    s, tau = model.settings, model.tau
    blocks = preintegrate(gyro[None], accel[None], model.interval, s.samples, s.samples_are_means)
    C_ns = s.C_nb @ model.C_bs  # nominal, at the start and at each update
    rotation_integral = C_ns[:-1] @ blocks.rotation_integral[:, 0]
    states = len(s.states) - ESTIMATED.start
    jacobian = np.zeros((len(rotation_integral), MECHANIZED.stop, states))
    jacobian[:, VELOCITY, _ACCEL] = jacobian[:, ATTITUDE, _GYRO] = -rotation_integral
    jacobian[:, VELOCITY, _GYRO] = C_ns[:-1] @ blocks.dv_gyro_bias_jacobian[:, 0]
    if s.initial.scale:  # the axis column times the interval's mean rate is a gyro bias
        jacobian[:, :, among_estimated(s.layout.AXIS_COLUMN)] = (
            model.rate[:, None, None] * jacobian[:, :, _GYRO]
        )
    w_ie_n = earth_rate_n(s.latitude)
    earth = axis_rotation(w_ie_n / EARTH_RATE, -EARTH_RATE * tau)
    return UpdateIncrements(
        dv_n=(C_ns[:-1] @ blocks.dv[:, 0, :, None])[:, :, 0],
        relative_rotation=C_ns[:-1] @ blocks.C_start_end[:, 0] @ np.swapaxes(C_ns[1:], -1, -2),
        bias_jacobian=jacobian,
        rotation_integral=rotation_integral,
        rotation_double_integral=C_ns[:-1] @ blocks.rotation_double_integral[:, 0],
        earth_rotation=np.concatenate([earth, 0.5 * (_ONE + earth)]),
        coriolis_matrix=_ONE + coriolis(s.latitude) * tau,
        gravity_dv=np.array([0.0, 0.0, -s.gravity * tau]),
    )


def propagate(
    increments: UpdateIncrements,
    k: int,
    C_error: FloatArray,
    v_n: FloatArray,
    bias_estimates: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Mechanize to update k: C_error (3, 3) and velocity (3,) just before it.

    bias_estimates: (m - 6,) estimates of the states from the biases on, which are subtracted.
    Nonlinear: v' = C_ns f + g - 2 w_ie x v, C_ns' = C_ns [w_is_s x] - [w_ie_n x] C_ns.
    """
    known = increments.bias_jacobian[k].dot(bias_estimates)
    frames = increments.earth_rotation.dot(C_error)
    dv = frames[3:].dot(increments.dv_n[k] + known[:3])
    v_n = increments.coriolis_matrix.dot(v_n) + dv + increments.gravity_dv
    return frames[:3].dot(_rotation(known[3:])).dot(increments.relative_rotation[k]), v_n


def _rotation(phi: FloatArray) -> FloatArray:
    """Return the rotation matrix (3, 3) of a rotation vector (3,), rad (Rodrigues)."""
    X = phi.dot(_SKEW).reshape(3, 3)
    angle = sqrt(phi.dot(phi))
    first, second = (sin(angle) / angle, sin(0.5 * angle) / angle) if angle else (1.0, 0.5)
    result: FloatArray = X.dot(X)
    result *= 2.0 * second * second
    result += first * X
    result += _ONE
    return result


def to_nearest_rotation(M: FloatArray) -> FloatArray:
    """Return M (3, 3), a rotation except for rounding, after one Newton step to the nearest one."""
    return np.asarray(0.5 * M.dot(3.0 * _ONE - M.T.dot(M)))


def filter_updates(
    model: UpdateModel,
    increments: UpdateIncrements,
    state: FilterState,
    gains: FilterGains | None,
    P: FloatArray,
) -> tuple[UpdateResults, FilterGains]:
    """Mechanize and update, one update after the other; return the results and the gains.

    gains: of the slaved filter; None for a free azimuth: they depend on the computed attitude and
    are computed from the prior covariance P (m, m).
    """
    s, n, m = model.settings, len(increments.dv_n), len(model.settings.states)
    rotations, velocity, azimuth = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty(n)
    estimates = np.empty((n, m - ESTIMATED.start))
    corrections, innovations = np.empty((n, m)), np.empty((n, 3))
    free = _FreeGains(model, increments, P) if gains is None else None
    K = free.gains.K if free else gains.K  # type: ignore[union-attr]
    H_lever = model.linear.H_rest
    at = among_estimated(s.layout.LEVER_ARM)
    feedback = -np.ones(3) if free else -LEVEL
    M, v, bias_estimates = state.C_error, state.velocity, state.bias_estimates
    for k in range(n):
        if free:
            free.compute(k, M)
        M, v = propagate(increments, k, M, v, bias_estimates)
        z = v - model.lever_arm_velocity[k + 1]
        if H_lever is not None:
            z -= H_lever[k].dot(bias_estimates[at])
        innovations[k] = z
        x = K[k].dot(z, out=corrections[k])
        v = v - x[VELOCITY]
        bias_estimates = bias_estimates + x[ESTIMATED]
        M = _rotation(feedback * x[ATTITUDE]).dot(M)
        if (state.updates + k) % _UPDATES_PER_ORTHOGONALIZATION == 0:
            M = to_nearest_rotation(M)
        (a, b, _), (c, d, _), _ = M.tolist()
        azimuth[k] = atan2(c - b, a + d)
        if not free:  # rotated back to the table's azimuth
            size = hypot(c - b, a + d)
            cos, sine = (a + d) / size, (c - b) / size
            back = np.array([[cos, sine, 0.0], [-sine, cos, 0.0], [0.0, 0.0, 1.0]])
            M, v = back.dot(M), back.dot(v)
        rotations[k], velocity[k], estimates[k] = M, v, bias_estimates
    results = UpdateResults(rotations, velocity, estimates, azimuth, corrections, innovations)
    return results, free.gains if free else gains  # type: ignore[return-value]


class _FreeGains:
    """The gains of a filter with a free azimuth, about the attitude computed so far."""

    def __init__(self, model: UpdateModel, increments: UpdateIncrements, P: FloatArray) -> None:
        n, m = len(increments.dv_n), len(model.settings.states)
        self._model, self._increments, self._P = model, increments, P
        self._H = model.linear.H
        self._R = np.broadcast_to(model.linear.measurement_noise, (n, 3, 3))
        self.gains = Gains(
            K=np.empty((n, m, 3)),
            S=np.empty((n, 3, 3)),
            sigma=np.empty((n, m)),
            P=np.empty((m, m)),
            Phi=model.linear.Phi,
            prior=np.empty((n, m, m)),
            posterior=np.empty((n, m, m)),
        )

    def compute(self, k: int, M: FloatArray) -> None:
        """Compute the gains of update k about the computed attitude error M (3, 3) before it."""
        model, increments, gains = self._model, self._increments, self.gains
        s, Phi = model.settings, gains.Phi[k]
        integral = M @ increments.rotation_integral[k]
        fill_transition(Phi, integral, M @ increments.rotation_double_integral[k], s, model.tau)
        if s.initial.scale:
            Phi[MECHANIZED, s.layout.AXIS_COLUMN] = model.rate[k] * Phi[MECHANIZED, GYRO_BIAS]
        gains.prior[k] = kalman.predict(self._P, Phi, model.linear.Q)
        update = kalman.update(gains.prior[k], self._H[k], self._R[k])
        gains.K[k], gains.S[k], gains.posterior[k] = update
        self._P = gains.P[:] = gains.posterior[k]
        gains.sigma[k] = np.sqrt(np.diag(self._P))
