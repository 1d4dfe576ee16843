"""Error budget of a rotation scheme: errors that constant sensor errors cause in one turn.

In n the sensor errors appear as `C_ns b`, `C_ns d` and `C_ns N w_is_s`, with
`w_is_s = C_sn w_ie_n + w u` for a table turning at the rate w about the axis u (R16 (10) to (25)).
`closed_form` and `integrated` are their integrals over a turn (R16 table 1); what navigation shows
is navigated (`rotcli.budget.navigation`). Errors are computed minus true:
`C_hat = (I + [eps x]) C`, eps in n.
R16 is "MEMS IMU Error Mitigation Using Rotation Modulation Technique", Sensors 2016, 16, 2017.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np

from rotcli.budget.calibration_time import (
    TIMES,
    CalibrationTime,
    best_calibration_time,
    calibration_sigmas,
)
from rotcli.budget.navigation import MAX_TIME, NavigationErrors, SensorError, navigation_errors
from rotcli.dataclass import dataclass
from rotcli.models import rotation
from rotcli.models.base import FixedBase
from rotcli.models.sensors import NoiseFigures, TriadErrors
from rotcli.units import FloatArray

ACCEL_BIAS, GYRO_BIAS = "accelerometer_bias", "gyro_bias"
GYRO_SCALE, GYRO_INSTALLATION = "gyro_scale_factor", "gyro_installation"
SOURCES = (ACCEL_BIAS, GYRO_BIAS, GYRO_SCALE, GYRO_INSTALLATION)
STILL = "still"  # the table does not turn: nothing is modulated

_NODES = 24  # the integrands have two harmonics of the turn: a dozen nodes already give 1e-12


@dataclass(frozen=True, eq=False)
class NavigationError:
    """Errors of navigation, each (3,) in n: attitude (rad), velocity (m/s), position (m)."""

    attitude: FloatArray
    velocity: FloatArray
    position: FloatArray

    @classmethod
    def at_end(cls, errors: NavigationErrors) -> "NavigationError":
        """Return the errors at the last sample."""
        return cls(errors.attitude[-1], errors.velocity[-1], errors.position[-1])


@dataclass(frozen=True, eq=False)
class WithinTurn:
    """One source within one turn, at table angles (n,) rad.

    error: (n, 3) in n, the sensors' error itself, m/s^2 or rad/s; navigated: what navigation makes
    of it.
    """

    angle: FloatArray
    error: FloatArray
    navigated: NavigationErrors


@dataclass(frozen=True, eq=False)
class TurnError:
    """The error of one source after one turn about one axis.

    closed_form, integrated: (3,) in n, velocity (m/s) for the accelerometer bias, attitude (rad)
    for the gyro sources. within: None where a turn takes more than an hour.
    """

    axis: str
    source: str
    closed_form: FloatArray
    integrated: FloatArray
    within: WithinTurn | None

    @property
    def navigated(self) -> NavigationError | None:
        """What navigation shows after the turn."""
        return None if self.within is None else NavigationError.at_end(self.within.navigated)


@dataclass(frozen=True, eq=False)
class Growth:
    """What one source grows to over the budget's duration.

    unmodulated: by R16 (26), (27), of what a turn does not average out. navigated: with all else.
    """

    axis: str
    source: str
    unmodulated: NavigationError
    navigated: NavigationError


@dataclass(frozen=True, eq=False)
class Budget:
    """An error budget, SI. rate: rad/s; period, duration: s.

    totals: what navigation shows of all sources together after `duration`, by scheme: not the sum
    of the sources, because navigation is not linear in them. best: the row of `calibration` with
    the best time, None where the noise figures have none; best_is_minimum: whether the sigma
    rises again past it, or only falls no further.
    """

    base: FixedBase
    rate: float
    period: float
    duration: float
    gyro: TriadErrors
    accel_bias: FloatArray
    noise: NoiseFigures
    turns: tuple[TurnError, ...]
    growth: tuple[Growth, ...]
    totals: Mapping[str, NavigationError]
    calibration: tuple[CalibrationTime, ...]
    best: CalibrationTime | None
    best_is_minimum: bool


def budget(
    gyro: TriadErrors,
    accel_bias: FloatArray,
    noise: NoiseFigures,
    base: FixedBase,
    *,
    rate: float,
    axes: Sequence[str] = ("x", "y", "z"),
    duration: float = 300.0,
) -> Budget:
    """Return the budget of turning about each of the axes (`x`, `y`, `z` of the body).

    accel_bias: (3,) m/s^2; noise: the gyros' figures; rate: rad/s, not zero, negative for
    left-handed turns; duration: s, for the growth. Turns start at table angle 0.
    """
    parts = split(gyro, accel_bias)
    turns, growth, totals = [], [], {}
    for scheme in (*axes, STILL):
        u = np.zeros(3) if scheme == STILL else np.array(rotation.UNIT_VECTORS[scheme])
        speed = 0.0 if scheme == STILL else rate
        for source, (bias, matrix) in parts.items():
            if scheme == STILL:
                error = base.C_nb @ (bias + matrix @ base.C_nb.T @ base.w_ie_n)
            else:
                turns.append(one_turn(scheme, source, bias, matrix, base, rate))
                error = turns[-1].closed_form / period(rate)
            sensors = _sensor_error(source, bias, matrix)
            seen = NavigationError.at_end(navigation_errors(sensors, base, u, speed, duration))
            left = unmodulated(source, error, base.gravity, duration)
            growth.append(Growth(scheme, source, left, seen))
        every = SensorError(gyro.bias, gyro.matrix, accel_bias)
        totals[scheme] = NavigationError.at_end(navigation_errors(every, base, u, speed, duration))
    rows = tuple(calibration_sigmas(noise, time, rate) for time in TIMES)
    best_time, is_minimum = best_calibration_time(noise)
    return Budget(
        base=base,
        rate=rate,
        period=period(rate),
        duration=duration,
        gyro=gyro,
        accel_bias=accel_bias,
        noise=noise,
        turns=tuple(turns),
        growth=tuple(growth),
        totals=totals,
        calibration=rows if noise.allan_variance(np.ones(1))[0] > 0.0 else (),
        best=None if best_time is None else calibration_sigmas(noise, best_time, rate),
        best_is_minimum=is_minimum,
    )


def one_turn(
    axis: str, source: str, bias: FloatArray, matrix: FloatArray, base: FixedBase, rate: float
) -> TurnError:
    """Return the error of one source after one turn about an axis (`x`, `y`, `z` of the body)."""
    u = np.array(rotation.UNIT_VECTORS[axis])
    within = None
    if period(rate) <= MAX_TIME:
        sensors = _sensor_error(source, bias, matrix)
        found = navigation_errors(sensors, base, u, rate, period(rate))
        errors = error_in_n(bias, matrix, base, u, rate, found.time)
        within = WithinTurn(rate * found.time, errors, found)
    return TurnError(
        axis=axis,
        source=source,
        closed_form=closed_form(bias, matrix, base, u, rate),
        integrated=integrated(bias, matrix, base, u, rate),
        within=within,
    )


def _sensor_error(source: str, bias: FloatArray, matrix: FloatArray) -> SensorError:
    """Return one source as errors of the triads."""
    if source == ACCEL_BIAS:
        return SensorError(np.zeros(3), np.zeros((3, 3)), bias)
    return SensorError(bias, matrix, np.zeros(3))


def period(rate: float) -> float:
    """Return the time of one turn (s)."""
    return 2.0 * np.pi / abs(rate)


def split(gyro: TriadErrors, accel_bias: FloatArray) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return each source as (constant part (3,), matrix (3, 3)) of the sensor's error."""
    none, scale = np.zeros((3, 3)), np.diag(np.diag(gyro.matrix))
    return {
        ACCEL_BIAS: (accel_bias, none),
        GYRO_BIAS: (gyro.bias, none),
        GYRO_SCALE: (np.zeros(3), scale),
        GYRO_INSTALLATION: (np.zeros(3), gyro.matrix - scale),
    }


def closed_form(
    bias: FloatArray, matrix: FloatArray, base: FixedBase, u: FloatArray, rate: float
) -> FloatArray:
    """Return the error (3,) in n after one turn about u (3,) in b, by formula.

    Turning averages a vector to its part along u, and a matrix to what commutes with the
    turning, `N_u u u^T + half the rest of its trace (I - u u^T) + its twist about u [u x]`. For
    u = x, y, z on a level base that is R16 table 1.
    """
    along = float(u @ matrix @ u)
    across = 0.5 * (float(np.trace(matrix)) - along)
    twist = 0.5 * float(np.sum(rotation.skew(u) * matrix))
    w_ie_b = base.w_ie_b
    w_u = float(u @ w_ie_b)
    mean_b = (
        float(u @ bias) * u
        + along * (rate + w_u) * u
        + across * (w_ie_b - w_u * u)
        + twist * np.cross(u, w_ie_b)
    )
    return np.asarray(period(rate) * base.C_nb @ mean_b)


@lru_cache(maxsize=1)
def _gauss() -> tuple[FloatArray, FloatArray]:
    """Return nodes and weights (m,) of the Gauss-Legendre quadrature over [-1, 1]."""
    return np.polynomial.legendre.leggauss(_NODES)


def error_in_n(
    bias: FloatArray,
    matrix: FloatArray,
    base: FixedBase,
    u: FloatArray,
    rate: float,
    time: FloatArray,
) -> FloatArray:
    """Return the error `C_ns (bias + matrix w_is_s)` (n, 3) in n at times (n,) s.

    u: (3,) rotation axis in b; rate: rad/s. Source: R16 (10) to (25).
    """
    C_ns = base.C_nb @ rotation.axis_rotation(u, rate * time)
    w_is_s = base.w_ie_n @ C_ns + rate * u  # rows: C_sn w_ie_n + w u
    return np.asarray((C_ns @ (bias + w_is_s @ matrix.T)[:, :, None])[:, :, 0])


def integrated(
    bias: FloatArray, matrix: FloatArray, base: FixedBase, u: FloatArray, rate: float
) -> FloatArray:
    """Return the error (3,) in n after one turn, the integral of `C_ns (bias + matrix w_is_s)`."""
    x, weight = _gauss()
    half = 0.5 * period(rate)
    return np.asarray(half * weight @ error_in_n(bias, matrix, base, u, rate, half * (x + 1.0)))


def unmodulated(source: str, error: FloatArray, g: float, t: float) -> NavigationError:
    """Return what a steady error (3,) in n, m/s^2 or rad/s, grows to in t (s), R16 (26), (27)."""
    if source == ACCEL_BIAS:  # b t, b t^2 / 2
        return NavigationError(np.zeros(3), error * t, error * t**2 / 2.0)
    tilted = g * np.array([error[1], -error[0], 0.0])  # eps x f, f = (0, 0, g)
    return NavigationError(
        error * t, tilted * t**2 / 2.0, tilted * t**3 / 6.0
    )  # g d t^2 / 2, g d t^3 / 6
