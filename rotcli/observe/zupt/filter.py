"""Running the ZUPT filter over a log, its estimates, and smoothing.

A log is filtered chunk by chunk; `ZuptFilter` keeps the state between two chunks, so that the
chunks together give the results of the complete log filtered at once. The part of the model that
needs no data is in `rotcli.observe.zupt.model`, the updates are in `rotcli.observe.zupt.updates`.
"""

from dataclasses import replace

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models import kalman
from rotcli.models.kalman import FilterGains, Gains, SmootherState
from rotcli.models.rotation import (
    axis_rotation,
    euler_angles,
    matrix_from_quaternion,
    quaternion_from_vector,
)
from rotcli.observe.zupt.kalman_blocks import inverse_symmetric_3
from rotcli.observe.zupt.model import (
    ATTITUDE,
    AZIMUTH,
    ESTIMATED,
    TILT,
    VELOCITY,
    Settings,
    UpdateModel,
)
from rotcli.observe.zupt.newton import solve_updates
from rotcli.observe.zupt.updates import (
    FilterState,
    UpdateResults,
    filter_updates,
    preintegrate_updates,
)
from rotcli.units import DEG, FloatArray, wrap_pi

# rad: a table that deviates more from its nominal attitude is filtered again about the attitude
# estimated: the transitions are right to first order only (2 deg: 0.2 deg of azimuth).
MAX_LINEAR_TILT = 0.3 * DEG
# A tilt is significant beyond so many of its sigmas: 6e-5 of false alarms in two normal numbers.
TILT_SIGMAS = 4.0
# A log of fewer updates (20 minutes at 10 Hz) is filtered one update after the other: solving them
# together saves 8 us of each, which is less than the 0.1 s that the import of the solver costs.
MIN_TOGETHER = 12_000


@dataclass(frozen=True, eq=False)
class Estimates:
    """Estimates of n consecutive updates, SI.

    C_nb: (3, 3) the nominal attitude. time: (n,) s, from the first sample of the log. values:
    (n, m) of `states`: velocity of the axis, rotation of the table from its nominal attitude
    (tilts in n, azimuth clockwise), sensor biases, lever arm perpendicular to the axis, axis
    column. sigma: (n, m). nis: (n,). table_angle, relative_angle: (n,) rad, rotation of the
    table in each update, and that of the sensors about the axis relative to it. P: (m, m)
    covariance after the last update.
    """

    states: tuple[str, ...]
    C_nb: FloatArray
    time: FloatArray
    values: FloatArray
    sigma: FloatArray
    nis: FloatArray
    table_angle: FloatArray
    relative_angle: FloatArray
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


class ZuptFilter:
    """The filter of a log, chunk by chunk; it keeps the state between two chunks."""

    def __init__(self, settings: Settings, count: int) -> None:
        """Start a filter of `count` updates."""
        self.settings = settings
        self._together = settings.slave_azimuth and count >= MIN_TOGETHER
        self._P: FloatArray | None = None  # (m, m)
        self._state: FilterState | None = None
        self._azimuth_sum = 0.0  # rad, by which the slaved frame was rotated back

    @property
    def done(self) -> int:
        """Number of updates so far."""
        return 0 if self._state is None else self._state.updates

    def advance(
        self,
        model: UpdateModel,
        gyro: FloatArray,
        accel: FloatArray,
        gains: FilterGains | None = None,
    ) -> FilteredUpdates:
        """Filter the next chunk of a log.

        gyro (rad/s), accel (m/s^2): (n samples + 1, 3), in s; the first is the sample of the last
        update, or of the log's start. gains: of the model, where they are known.
        """
        s = self.settings
        prior = model.P0 if self._P is None else self._P
        state = self._state or FilterState(
            np.eye(3), model.lever_arm_velocity[0], np.zeros(len(s.states) - ESTIMATED.start)
        )
        if gains is None and s.slave_azimuth:
            gains = model.gains(prior)
        increments = preintegrate_updates(model, gyro, accel)
        if gains is not None and self._together:
            results = solve_updates(model, increments, state, gains)
        else:
            results, gains = filter_updates(model, increments, state, gains, prior)
        self._state, self._P = results.last(state.updates), gains.P
        estimates = Estimates(
            states=s.states,
            C_nb=s.C_nb,
            time=model.tau * np.arange(state.updates + 1.0, self.done + 1.0),
            values=self._values(model, results),
            sigma=gains.sigma,
            nis=_normalized_squares(results.innovations, gains.S),
            table_angle=model.rate * model.tau,
            relative_angle=_angle_about(s.C_nb @ s.axis, increments.relative_rotation),
            P=gains.P.copy(),
        )
        return FilteredUpdates(estimates, prior, results.corrections)

    def _values(self, model: UpdateModel, results: UpdateResults) -> FloatArray:
        """Return the values (n, m) of the states after each update."""
        s, n = self.settings, len(results.velocity)
        values = np.empty((n, len(s.states)))
        values[:, ESTIMATED] = results.bias_estimates
        values[:, VELOCITY] = results.velocity - model.lever_arm_velocity[1:]
        if model.linear.H_rest is not None:
            lever_arm = values[:, s.layout.LEVER_ARM]
            values[:, VELOCITY] -= np.einsum("kij,kj->ki", model.linear.H_rest, lever_arm)
        M, azimuth = results.C_error, results.azimuth
        values[:, TILT.start] = 0.5 * (M[:, 2, 1] - M[:, 1, 2])
        values[:, TILT.start + 1] = 0.5 * (M[:, 0, 2] - M[:, 2, 0])
        if s.slave_azimuth:
            increments = azimuth - results.corrections[:, AZIMUTH]
            azimuth = np.cumsum(np.append(self._azimuth_sum, increments))[1:]
            self._azimuth_sum = float(azimuth[-1])
        values[:, AZIMUTH] = wrap_pi(-azimuth)
        return values


def _angle_about(axis: FloatArray, M: FloatArray) -> FloatArray:
    """Return the rotation (n,), rad, of matrices M (n, 3, 3) about an axis, -pi to pi."""
    x = M[:, 2, 1] - M[:, 1, 2], M[:, 0, 2] - M[:, 2, 0], M[:, 1, 0] - M[:, 0, 1]
    sine = 0.5 * (axis[0] * x[0] + axis[1] * x[1] + axis[2] * x[2])
    return np.asarray(np.arctan2(sine, 0.5 * (np.trace(M, axis1=1, axis2=2) - 1.0)))


def _normalized_squares(z: FloatArray, S: FloatArray) -> FloatArray:
    """Return z' S^-1 z (n,) of innovations z (n, 3)."""
    inverse = inverse_symmetric_3(S)
    return np.asarray(((inverse @ z[:, :, None])[:, :, 0] * z).sum(axis=1))


def smooth_updates(
    model: UpdateModel, part: FilteredUpdates, next_state: SmootherState | None = None
) -> tuple[Estimates, SmootherState]:
    """Return a chunk of the slaved filter smoothed, and the state that the chunk before it needs.

    next_state: as returned for the chunk that follows; None for the last.
    """
    gains = model.gains(part.prior_covariance, covariances=True)
    if not isinstance(gains, Gains):
        raise TypeError("smoothing needs the covariances of each update")
    corrections, P, first = kalman.smoothing_corrections(gains, part.corrections, next_state)
    values = part.estimates.values + ERROR_SIGNS[: corrections.shape[-1]] * corrections
    values[:, AZIMUTH] = wrap_pi(values[:, AZIMUTH])
    sigma = np.sqrt(np.diagonal(P, axis1=-2, axis2=-1))
    return replace(part.estimates, values=values, sigma=sigma, P=P[-1].copy()), first


def run(
    model: UpdateModel, gyro: FloatArray, accel: FloatArray, gains: FilterGains | None = None
) -> Estimates:
    """Filter a log at once, smoothed where the settings say so.

    gyro (rad/s), accel (m/s^2): (n, 3), in s. gains: those of the model, where they are known.
    Smoothing needs the slaved azimuth: without it there is no gain sequence to go back through.
    """
    s = model.settings
    part = ZuptFilter(s, len(model.rate)).advance(model, gyro, accel, gains)
    return smooth_updates(model, part)[0] if s.smooth and s.slave_azimuth else part.estimates
