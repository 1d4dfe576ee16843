"""Error budget of a rotation scheme: what one turn of the table leaves of constant sensor errors.

In n the sensor errors appear as `C_ns b`, `C_ns d` and `C_ns N w_is_s`, with
`w_is_s = C_sn w_ie_n + w u` for a table turning at the rate w about the axis u. `closed_form` and
`integrated` are their integrals over a turn (R16 table 1). Errors are computed minus true:
`C_hat = (I + [eps x]) C`, eps in n.
R16 is "Rotary Inertial Navigation System Based on MEMS IMU", Sensors 2016, 16, 2017.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from rotcli.models import earth, rotation
from rotcli.models.base import FixedBase
from rotcli.models.sensors import FLICKER_FLOOR, NoiseFigures, TriadErrors
from rotcli.units import DEG

Array = NDArray[np.float64]

ACCEL_BIAS, GYRO_BIAS = "accelerometer_bias", "gyro_bias"
GYRO_SCALE, GYRO_INSTALLATION = "gyro_scale_factor", "gyro_installation"
SOURCES = (ACCEL_BIAS, GYRO_BIAS, GYRO_SCALE, GYRO_INSTALLATION)
STILL = "still"  # the table does not turn: nothing is modulated

CALIBRATION_TIMES = (10.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0)  # s
_NODES = 24  # the integrands hold two harmonics of the turn: a dozen nodes already give 1e-12
_SMALL = 0.1  # rad: beyond it the equations, linear in tilt, overstate the growth


@dataclass(frozen=True, eq=False)
class Seen:
    """Errors of navigation, each (3,) in n: attitude (rad), velocity (m/s), position (m)."""

    attitude: Array
    velocity: Array
    position: Array


@dataclass(frozen=True, eq=False)
class Turn:
    """What one source leaves after one turn about one axis.

    closed_form, integrated: (3,) in n, velocity (m/s) for the accelerometer bias, attitude (rad)
    for the gyro sources.
    """

    axis: str
    source: str
    closed_form: Array
    integrated: Array
    navigated: Seen


@dataclass(frozen=True, eq=False)
class Growth:
    """What one source grows to over the budget's duration.

    unmodulated: by R16 (26), (27), of what a turn does not average out. navigated: with all else.
    """

    axis: str
    source: str
    unmodulated: Seen
    navigated: Seen


@dataclass(frozen=True)
class CalibrationTime:
    """Predicted sigmas of a calibration whose still and turning segments last `time` (s) each.

    bias (rad/s), column (fraction): with every noise; bias_white, column_white: of white noise
    alone, R16 (35), (36).
    """

    time: float
    bias: float
    bias_white: float
    column: float
    column_white: float


@dataclass(frozen=True, eq=False)
class Budget:
    """An error budget, SI. rate: rad/s; period, duration: s.

    best: the row of `calibration` with the best time, None where the noise figures have none;
    best_is_minimum: whether the sigma rises again past it, or only falls no further.
    """

    base: FixedBase
    rate: float
    period: float
    duration: float
    gyro: TriadErrors
    accel_bias: Array
    noise: NoiseFigures
    turns: tuple[Turn, ...]
    growth: tuple[Growth, ...]
    calibration: tuple[CalibrationTime, ...]
    best: CalibrationTime | None
    best_is_minimum: bool
    warnings: tuple[str, ...]


def budget(
    gyro: TriadErrors,
    accel_bias: Array,
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
    turns, growth = [], []
    for axis in axes:
        u = np.array(rotation.UNIT_VECTORS[axis])
        for source, (bias, matrix) in parts.items():
            closed = closed_form(bias, matrix, base, u, rate)
            motion = (source, bias, matrix, base, u, rate)
            turns.append(
                Turn(
                    axis=axis,
                    source=source,
                    closed_form=closed,
                    integrated=integrated(bias, matrix, base, u, rate),
                    navigated=navigated(*motion, period(rate)),
                )
            )
            left = unmodulated(source, closed / period(rate), base.gravity, duration)
            growth.append(Growth(axis, source, left, navigated(*motion, duration)))
    for source, (bias, matrix) in parts.items():
        error = base.C_nb @ (bias + matrix @ base.C_nb.T @ base.w_ie_n)
        left = unmodulated(source, error, base.gravity, duration)
        seen = navigated(source, bias, matrix, base, np.zeros(3), 0.0, duration)
        growth.append(Growth(STILL, source, left, seen))
    rows = tuple(calibration_sigmas(noise, time, rate) for time in CALIBRATION_TIMES)
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
        calibration=rows if noise.allan_variance(np.ones(1))[0] > 0.0 else (),
        best=None if best_time is None else calibration_sigmas(noise, best_time, rate),
        best_is_minimum=is_minimum,
        warnings=_warnings(growth, duration),
    )


def period(rate: float) -> float:
    """Return the time of one turn (s)."""
    return 2.0 * np.pi / abs(rate)


def split(gyro: TriadErrors, accel_bias: Array) -> dict[str, tuple[Array, Array]]:
    """Return each source as (constant part (3,), matrix (3, 3)) of the sensor's error."""
    none, scale = np.zeros((3, 3)), np.diag(np.diag(gyro.matrix))
    return {
        ACCEL_BIAS: (accel_bias, none),
        GYRO_BIAS: (gyro.bias, none),
        GYRO_SCALE: (np.zeros(3), scale),
        GYRO_INSTALLATION: (np.zeros(3), gyro.matrix - scale),
    }


def closed_form(bias: Array, matrix: Array, base: FixedBase, u: Array, rate: float) -> Array:
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
def _gauss() -> tuple[Array, Array]:
    """Return nodes and weights (m,) of the Gauss-Legendre quadrature over [-1, 1]."""
    return np.polynomial.legendre.leggauss(_NODES)


def _nodes(
    bias: Array, matrix: Array, base: FixedBase, u: Array, rate: float, span: float
) -> tuple[Array, Array]:
    """Return quadrature weights (m,) over `span` (s) and the error in n at the nodes (m, 3)."""
    x, weight = _gauss()
    time = 0.5 * span * (x + 1.0)
    C_ns = base.C_nb @ rotation.axis_rotation(u, rate * time)
    w_is_s = base.w_ie_n @ C_ns + rate * u  # rows: C_sn w_ie_n + w u
    errors = (C_ns @ (bias + w_is_s @ matrix.T)[:, :, None])[:, :, 0]
    return 0.5 * span * weight, errors


def integrated(bias: Array, matrix: Array, base: FixedBase, u: Array, rate: float) -> Array:
    """Return the error (3,) in n after one turn, the integral of `C_ns (bias + matrix w_is_s)`."""
    weight, errors = _nodes(bias, matrix, base, u, rate, period(rate))
    return np.asarray(weight @ errors)


def unmodulated(source: str, error: Array, g: float, t: float) -> Seen:
    """Return what a steady error (3,) in n, m/s^2 or rad/s, grows to in t (s), R16 (26), (27)."""
    if source == ACCEL_BIAS:  # b t, b t^2 / 2
        return Seen(np.zeros(3), error * t, error * t**2 / 2.0)
    tilted = g * np.array([error[1], -error[0], 0.0])  # eps x f, f = (0, 0, g)
    return Seen(error * t, tilted * t**2 / 2.0, tilted * t**3 / 6.0)  # g d t^2 / 2, g d t^3 / 6


def navigated(
    source: str, bias: Array, matrix: Array, base: FixedBase, u: Array, rate: float, duration: float
) -> Seen:
    """Return the errors that navigation shows after `duration` (s), to first order.

    R16 table 1, (26) and (27) leave out that the Earth turns under the errors made so far, and
    that what turning modulates swings about a mean that is not zero. Both are here:
    `psi' = -w_ie x psi + C_ns (d + N w_is_s)`, `eps = psi - (-p_N/R_M, p_E/R_N, p_E tan L/R_N)`,
    `v' = eps x f - 2 w_ie x v + (0, 0, 2g/R p_U) + C_ns b`, `p' = v`
    (psi: the attitude error against the frame of the computed position).
    """
    driven = slice(3, 6) if source == ACCEL_BIAS else slice(0, 3)

    def gain(span: float) -> tuple[Array, Array]:
        """Return the transition over `span` and what it adds; every turn starts the same."""
        weight, errors = _nodes(bias, matrix, base, u, rate, span)
        over, ahead = _transitions(base, span)
        return over, weight @ (ahead[:, :, driven] @ errors[:, :, None])[:, :, 0]

    piece = period(rate) if rate else duration
    steps = int(duration / piece + 1e-9)
    state = np.zeros(9)
    if steps:
        transition, added = gain(piece)
        for _ in range(steps):
            state = transition @ state + added
    rest = duration - steps * piece
    if rest > 1e-9 * piece:
        transition, added = gain(rest)
        state = transition @ state + added
    psi, v, p = state.reshape(3, 3)
    return Seen(psi - _turned_by_position(base) @ p, v, p)


@lru_cache(maxsize=8)
def _transitions(base: FixedBase, span: float) -> tuple[Array, Array]:
    """Return the transition (9, 9) over `span` (s), and from the nodes (m, 9, 9) to its end."""
    from scipy.linalg import expm

    F = _dynamics(base)
    left: Array = 0.5 * span * (1.0 - _gauss()[0])
    return expm(F * span), expm(F * left[:, None, None])


def _turned_by_position(base: FixedBase) -> Array:
    """Return the matrix (3, 3) from a displacement (m) in n to the turn of n (rad)."""
    R_M, R_N = (float(radius) for radius in earth.radii(base.latitude))
    tan = float(np.tan(base.latitude))
    return np.array([[0.0, -1.0 / R_M, 0.0], [1.0 / R_N, 0.0, 0.0], [tan / R_N, 0.0, 0.0]])


def _dynamics(base: FixedBase) -> Array:
    """Return F (9, 9) of the states psi, v, p."""
    w_ie, force = rotation.skew(base.w_ie_n), -rotation.skew(np.array([0.0, 0.0, base.gravity]))
    F = np.zeros((9, 9))
    F[:3, :3] = -w_ie
    F[3:6, :3] = force
    F[3:6, 3:6] = -2.0 * w_ie
    F[3:6, 6:] = -force @ _turned_by_position(base)
    F[5, 8] = 2.0 * base.gravity / earth.SEMI_MAJOR_AXIS
    F[6:, 3:6] = np.eye(3)
    return F


def calibration_sigmas(noise: NoiseFigures, time: float, rate: float) -> CalibrationTime:
    """Predict the sigmas of a calibration with `time` (s) for each of its two segments.

    The sigma of the mean rate is the Allan deviation at that time. White noise falls as
    N / sqrt(T) (R16 (35)); flicker stays at 0.664 B; a rate random walk makes the mean of the
    segment differ from the value at its end by K sqrt(T / 3), exactly, and so the sigma rises
    again: the trade of R16 section 4. Over the rate it is the sigma of a matrix element (36).
    """
    bias = float(np.sqrt(noise.allan_variance(np.array([time]))[0]))
    white = noise.white / float(np.sqrt(time))
    return CalibrationTime(time, bias, white, bias / abs(rate), white / abs(rate))


def best_calibration_time(noise: NoiseFigures) -> tuple[float | None, bool]:
    """Return the best segment length (s), and whether the sigma rises again past it.

    With a rate random walk K the minimum lies at sqrt(3) N / K. Without, nothing rises; the time
    at which white noise has fallen to the flicker's floor is returned: the sigma is then sqrt(2)
    of the floor. None without white noise or with nothing against it.
    """
    N, K, floor = noise.white, noise.rate_random_walk, FLICKER_FLOOR * noise.bias_instability
    if N and K:
        return float(np.sqrt(3.0)) * N / K, True
    return ((N / floor) ** 2, False) if N and floor else (None, False)


def _warnings(growth: Sequence[Growth], duration: float) -> tuple[str, ...]:
    found = []
    for axis in dict.fromkeys(g.axis for g in growth):
        tilt = sum((g.navigated.attitude for g in growth if g.axis == axis), np.zeros(3))[:2]
        size = float(np.hypot(*tilt))
        if size > _SMALL:
            scheme = "standing still" if axis == STILL else f"turning about {axis}"
            found.append(
                f"{scheme}, the tilt after {duration:g} s comes to {size / DEG:.3g} deg: the "
                "growth is linear in the tilt and overstates what is beyond 6 deg; "
                "take a shorter --duration or calibrated sensors"
            )
    return tuple(found)
