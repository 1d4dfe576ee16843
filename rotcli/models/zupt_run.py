"""Running the ZUPT filter: mechanize the sensor frame, update, feed back.

A log is filtered chunk by chunk; `ZuptFilter` keeps the state between two chunks, so that the
chunks together give the results of the complete log filtered at once. The part of the model that
needs no data is in `rotcli.models.zupt`.

The computed attitude is stored as the rotation C_error of the computed frame relative to the
nominal one, `C_ns = C_error C_nb C_bs(theta)`: it is near the identity, and everything that a
sample adds to it except for the biases is computed for all updates together.
"""

from dataclasses import dataclass, replace
from math import atan2, hypot, sin, sqrt

import numpy as np

from rotcli.models import kalman
from rotcli.models.earth import EARTH_RATE, earth_rate_n
from rotcli.models.errors_ins import coriolis
from rotcli.models.increments import preintegrate
from rotcli.models.kalman import Gains, SmootherState
from rotcli.models.rotation import (
    axis_rotation,
    euler_angles,
    matrix_from_quaternion,
    quaternion_from_vector,
    skew,
)
from rotcli.models.zupt import (
    ACCEL_BIAS,
    ATTITUDE,
    AZIMUTH,
    ESTIMATED,
    GYRO_BIAS,
    MECHANIZED,
    TILT,
    VELOCITY,
    Settings,
    UpdateModel,
    fill_transition,
)
from rotcli.units import DEG, FloatArray, wrap_pi

# rad: a table that deviates more from its nominal attitude is filtered again about the attitude
# estimated: the transitions are right to first order only (2 deg: 0.2 deg of azimuth).
MAX_LINEAR_TILT = 0.3 * DEG
# A tilt is significant beyond so many of its sigmas: 6e-5 of false alarms in two normal numbers.
TILT_SIGMAS = 4.0
_UPDATES_PER_ORTHOGONALIZATION = 10  # rounding of 10 products is 1e-15: one Newton step suffices

_ONE = np.eye(3)
_SKEW = skew(_ONE).reshape(3, 9)  # phi @ _SKEW contains the elements of skew(phi)
_LEVEL = np.array([1.0, 1.0, 0.0])
# Slices of velocity, attitude in the six mechanized rows, of the biases in the estimated states.
_V, _PHI = slice(0, 3), slice(3, 6)
_ACCEL = slice(ACCEL_BIAS.start - ESTIMATED.start, ACCEL_BIAS.stop - ESTIMATED.start)
_GYRO = slice(GYRO_BIAS.start - ESTIMATED.start, GYRO_BIAS.stop - ESTIMATED.start)


@dataclass(frozen=True, eq=False)
class Estimates:
    """Estimates of n consecutive updates, SI.

    C_nb: (3, 3) the nominal attitude. time: (n,) s, from the first sample of the log. values:
    (n, m) of `states`: velocity of the axis, rotation of the table from its nominal attitude
    (tilts in n, azimuth clockwise), sensor biases, lever arm perpendicular to the axis, axis
    column. sigma: (n, m). nis: (n,). P: (m, m) posterior covariance of the last update.
    """

    states: tuple[str, ...]
    C_nb: FloatArray
    time: FloatArray
    values: FloatArray
    sigma: FloatArray
    nis: FloatArray
    P: FloatArray

    @property
    def attitude_errors(self) -> FloatArray:
        """Errors of pitch, roll, azimuth (n, 3) against the given attitude, rad."""
        return attitude_errors(self.C_nb, self.values[:, ATTITUDE])


@dataclass(frozen=True, eq=False)
class FilteredUpdates:
    """Consecutive updates after the filter's pass, as `smooth_updates` needs them.

    prior_covariance: (m, m) before the first of them. corrections: (n, m) of the state.
    """

    estimates: Estimates
    prior_covariance: FloatArray
    corrections: FloatArray


# Sign with which a state's estimated error enters its value: errors of velocity and tilt are
# computed minus true; azimuth counts clockwise; biases and lever arm are true minus estimated.
ERROR_SIGNS = np.array([-1.0] * 5 + [1.0] * 12)


def attitude_errors(C_nb: FloatArray, deviation: FloatArray) -> FloatArray:
    """Return errors of pitch, roll, azimuth (..., 3), rad, of a body rotated away from C_nb.

    deviation: (..., 3) tilts about east and north, azimuth clockwise, rad.
    """
    tilt = np.append(deviation[..., :2], np.zeros_like(deviation[..., :1]), axis=-1)
    C_tilt = matrix_from_quaternion(quaternion_from_vector(np.moveaxis(tilt, -1, 0)))
    C_hat = axis_rotation(np.array([0.0, 0.0, 1.0]), -deviation[..., 2]) @ C_tilt @ C_nb
    pairs = zip(euler_angles(C_hat), euler_angles(C_nb), strict=True)
    return np.stack([wrap_pi(estimated - nominal) for estimated, nominal in pairs], axis=-1)


def significant_tilt(last: Estimates) -> FloatArray | None:
    """Return the tilts (2,) about east and north, rad, if large and significant at the end.

    None if the table keeps its nominal attitude within MAX_LINEAR_TILT or TILT_SIGMAS sigmas.
    """
    tilt: FloatArray = last.values[-1, TILT]
    size = float(np.hypot(*tilt))
    sigma = float(np.hypot(*last.sigma[-1, TILT]))
    return tilt if size > max(MAX_LINEAR_TILT, TILT_SIGMAS * sigma) else None


def tilted(C_nb: FloatArray, tilt: FloatArray) -> FloatArray:
    """Return the attitude (3, 3) of a table that tilts by (2,), rad, about east and north."""
    size = float(np.hypot(*tilt))
    result: FloatArray = axis_rotation(np.array([*tilt, 0.0]) / size, size) @ C_nb
    return result


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


def preintegrate_updates(
    model: UpdateModel, gyro: FloatArray, accel: FloatArray
) -> UpdateIncrements:
    """Integrate a log, gyro (rad/s) and accel (m/s^2) (n, 3), from update to update."""
    s, tau = model.settings, model.tau
    blocks = preintegrate(gyro[None], accel[None], model.interval, s.samples, s.samples_are_means)
    C_ns = s.C_nb @ model.C_bs  # nominal, at the start and at each update
    rotation_integral = C_ns[:-1] @ blocks.rotation_integral[:, 0]
    dv_gyro_bias_jacobian = C_ns[:-1] @ blocks.dv_gyro_bias_jacobian[:, 0]
    states = len(s.states) - ESTIMATED.start
    jacobian = np.zeros((len(rotation_integral), MECHANIZED.stop, states))
    jacobian[:, _V, _ACCEL] = jacobian[:, _PHI, _GYRO] = -rotation_integral
    jacobian[:, _V, _GYRO] = dv_gyro_bias_jacobian
    if s.initial.scale:  # the axis column times the interval's mean rate is a gyro bias
        column = s.layout.AXIS_COLUMN.start - ESTIMATED.start
        jacobian[:, :, column:] = model.rate[:, None, None] * jacobian[:, :, _GYRO]
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


class ZuptFilter:
    """The filter of a log, chunk by chunk; it keeps the state between two chunks."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.done = 0  # updates
        self._P: FloatArray | None = None  # (m, m)
        self._C_error, self._v = _ONE, np.zeros(3)
        self._bias_estimates = np.zeros(len(settings.states) - ESTIMATED.start)
        self._azimuth_sum = 0.0  # rad, by which the slaved frame was rotated back

    def advance(
        self, model: UpdateModel, gyro: FloatArray, accel: FloatArray, gains: Gains | None = None
    ) -> FilteredUpdates:
        """Filter the next chunk of a log.

        gyro (rad/s), accel (m/s^2): (n samples + 1, 3), in s; the first is the sample of the last
        update, or of the log's start. gains: of the model, where they are known.
        """
        s = self.settings
        prior = model.P0 if self._P is None else self._P
        if not self.done:
            self._v = model.lever_arm_velocity[0]
        if gains is None and s.slave_azimuth:
            gains = model.gains(prior)
        increments = preintegrate_updates(model, gyro, accel)
        values, corrections, innovations, gains = self._loop(model, increments, gains, prior)
        n = len(values)
        time: FloatArray = model.tau * np.arange(self.done + 1.0, self.done + n + 1.0)
        values[:, AZIMUTH] = wrap_pi(values[:, AZIMUTH])
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
        return FilteredUpdates(estimates, prior, corrections)

    def _loop(
        self, model: UpdateModel, increments: UpdateIncrements, gains: Gains | None, P: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, Gains]:
        """Mechanize and update; return values, corrections, innovations (n, ...) and the gains."""
        s, n, m = self.settings, len(model.rate), len(self.settings.states)
        values, corrections, innovations = np.empty((n, m)), np.empty((n, m)), np.empty((n, 3))
        rotations, azimuth = np.empty((n, 3, 3)), np.empty(n)
        slaved = gains is not None
        if gains is None:  # they depend on the computed attitude: computed in the loop
            K, S, prior = np.empty((n, m, 3)), np.empty((n, 3, 3)), np.empty((n, m, m))
            gains = Gains(model.Phi.copy(), K, S, prior, np.empty((n, m, m)))
        lever = s.layout.LEVER_ARM
        at = slice(lever.start - ESTIMATED.start, lever.stop - ESTIMATED.start)
        lever_H = model.H[1:, :, lever] if s.estimate_lever_arm else None
        feedback = -_LEVEL if slaved else -np.ones(3)
        M, v, bias_estimates = self._C_error, self._v, self._bias_estimates
        for k in range(n):
            if not slaved:
                self._update_gains(model, increments, gains, k, M, P)
                P = gains.posterior[k]
            M, v = propagate(increments, k, M, v, bias_estimates)
            z = v - model.lever_arm_velocity[k + 1]
            if lever_H is not None:
                z -= lever_H[k].dot(bias_estimates[at])
            innovations[k] = z
            x = gains.K[k].dot(z, out=corrections[k])
            v = v - x[VELOCITY]
            bias_estimates = bias_estimates + x[ESTIMATED]
            M = _rotation(feedback * x[ATTITUDE]).dot(M)
            # One Newton step towards the nearest rotation.
            if (self.done + k) % _UPDATES_PER_ORTHOGONALIZATION == 0:
                M = 0.5 * M.dot(3.0 * _ONE - M.T.dot(M))
            (a, b, _), (c, d, _), _ = M.tolist()
            azimuth[k] = atan2(c - b, a + d)
            if slaved:  # rotated back to the table's azimuth
                size = hypot(c - b, a + d)
                cos, sine = (a + d) / size, (c - b) / size
                back = np.array([[cos, sine, 0.0], [-sine, cos, 0.0], [0.0, 0.0, 1.0]])
                M, v = back.dot(M), back.dot(v)
            rotations[k], values[k, VELOCITY], values[k, ESTIMATED] = M, v, bias_estimates
        self._C_error, self._v, self._bias_estimates = M, v, bias_estimates
        if slaved:
            azimuth -= corrections[:, AZIMUTH]
            azimuth = np.cumsum(np.append(self._azimuth_sum, azimuth))[1:]
            self._azimuth_sum = float(azimuth[-1])
        values[:, VELOCITY] -= model.lever_arm_velocity[1:]
        if lever_H is not None:
            values[:, VELOCITY] -= np.einsum("kij,kj->ki", lever_H, values[:, lever])
        tilt_east = rotations[:, 2, 1] - rotations[:, 1, 2]
        tilt_north = rotations[:, 0, 2] - rotations[:, 2, 0]
        values[:, TILT] = 0.5 * np.stack([tilt_east, tilt_north], axis=1)
        values[:, AZIMUTH] = -azimuth
        return values, corrections, innovations, gains

    @staticmethod
    def _update_gains(
        model: UpdateModel,
        increments: UpdateIncrements,
        gains: Gains,
        k: int,
        M: FloatArray,
        P: FloatArray,
    ) -> None:
        """Compute the gains of update k of a free azimuth, about the computed attitude M (3, 3)."""
        s, Phi = model.settings, gains.Phi[k]
        integral = M @ increments.rotation_integral[k]
        fill_transition(Phi, integral, M @ increments.rotation_double_integral[k], s, model.tau)
        column = s.layout.AXIS_COLUMN
        Phi[MECHANIZED, column] = (
            model.rate[k] * Phi[MECHANIZED, GYRO_BIAS] if s.initial.scale else 0.0
        )
        gains.prior[k] = kalman.predict(P, Phi, model.Q)
        gains.K[k], gains.S[k], gains.posterior[k] = kalman.update(
            gains.prior[k], model.H[k + 1], model.R
        )


def smooth_updates(
    model: UpdateModel, part: FilteredUpdates, next_state: SmootherState | None = None
) -> tuple[Estimates, SmootherState]:
    """Return a chunk of the slaved filter smoothed, and the state that the chunk before it needs.

    next_state: as returned for the chunk that follows; None for the last.
    """
    gains = model.gains(part.prior_covariance)
    corrections, P, first = kalman.smoothing_corrections(gains, part.corrections, next_state)
    values = part.estimates.values + ERROR_SIGNS[: corrections.shape[-1]] * corrections
    values[:, AZIMUTH] = wrap_pi(values[:, AZIMUTH])
    sigma = np.sqrt(np.diagonal(P, axis1=-2, axis2=-1))
    return replace(part.estimates, values=values, sigma=sigma, P=P[-1].copy()), first


def run(
    model: UpdateModel, gyro: FloatArray, accel: FloatArray, gains: Gains | None = None
) -> Estimates:
    """Filter a log at once, smoothed where the settings say so.

    gyro (rad/s), accel (m/s^2): (n, 3), in s. gains: those of the model, where they are known.
    Smoothing needs the slaved azimuth: without it there is no gain sequence to go back through.
    """
    s = model.settings
    part = ZuptFilter(s).advance(model, gyro, accel, gains)
    return smooth_updates(model, part)[0] if s.smooth and s.slave_azimuth else part.estimates
