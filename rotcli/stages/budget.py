"""Error budget of a rotation scheme: what one turn of the table leaves of constant sensor errors.

In n the sensor errors appear as `C_ns b`, `C_ns d` and `C_ns N w_is_s`, with
`w_is_s = C_sn w_ie_n + w u` for a table turning at the rate w about the axis u. `closed_form` and
`integrated` are their integrals over a turn (R16 table 1). Errors are computed minus true:
`C_hat = (I + [eps x]) C`, eps in n.
R16 is "Rotary Inertial Navigation System Based on MEMS IMU", Sensors 2016, 16, 2017.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.models import earth, rotation
from rotcli.models.sensors import FLICKER_FLOOR, NoiseFigures, TriadErrors
from rotcli.units import DEG

Array = NDArray[np.float64]

ACCEL_BIAS, GYRO_BIAS = "accelerometer_bias", "gyro_bias"
GYRO_SCALE, GYRO_INSTALLATION = "gyro_scale_factor", "gyro_installation"
SOURCES = (ACCEL_BIAS, GYRO_BIAS, GYRO_SCALE, GYRO_INSTALLATION)
STILL = "still"  # the table does not turn: nothing is modulated

CALIBRATION_TIMES = (10.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0)  # s
_NODES = 48  # the integrands hold two harmonics of the turn: 32 nodes already give 1e-14
_SMALL = 0.1  # rad: beyond it the equations, linear in tilt, overstate the growth
_NOTHING = 1e-6  # m
_EQUAL = 1.01  # schemes whose position errors differ by less do equally well


@dataclass(frozen=True, eq=False)
class Base:
    """The still base: latitude (rad), gravity (m/s^2), attitude C_nb (3, 3)."""

    latitude: float
    gravity: float
    C_nb: Array

    @property
    def w_ie_n(self) -> Array:
        """The Earth rate (3,), rad/s."""
        return earth.earth_rate_n(self.latitude)


@dataclass(frozen=True, eq=False)
class Turn:
    """What one source leaves after one turn about one axis, each (3,) in n.

    closed_form, integrated: velocity (m/s) for the accelerometer bias, attitude (rad) for the
    gyro sources. attitude (rad), velocity (m/s): what navigation shows, see `navigated`.
    """

    axis: str
    source: str
    closed_form: Array
    integrated: Array
    attitude: Array
    velocity: Array


@dataclass(frozen=True, eq=False)
class Growth:
    """What one source grows to over the budget's duration, each (3,) in n.

    attitude (rad), velocity (m/s), position (m): of what is not modulated, R16 (26), (27).
    ripple_velocity, ripple_position: of the mean that the modulated part has within a turn.
    """

    axis: str
    source: str
    attitude: Array
    velocity: Array
    position: Array
    ripple_velocity: Array
    ripple_position: Array


@dataclass(frozen=True)
class CalibrationTime:
    """Predicted sigmas of a calibration whose still and turning stretches last `time` (s) each.

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

    base: Base
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
    recommendation: str
    warnings: tuple[str, ...]


def budget(
    gyro: TriadErrors,
    accel_bias: Array,
    noise: NoiseFigures,
    base: Base,
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
        u = np.array(rotation.AXES[axis])
        for source, (bias, matrix) in parts.items():
            closed = closed_form(bias, matrix, base, u, rate)
            turns.append(
                Turn(
                    axis=axis,
                    source=source,
                    closed_form=closed,
                    integrated=integrated(bias, matrix, base, u, rate),
                    **navigated(source, bias, matrix, base, u, rate),
                )
            )
            left = closed / period(rate)
            wave = ripple(bias, matrix, base, u, rate)
            growth.append(_growth(axis, source, left, wave, base.gravity, duration))
    for source, (bias, matrix) in parts.items():
        left = base.C_nb @ (bias + matrix @ base.C_nb.T @ base.w_ie_n)
        growth.append(_growth(STILL, source, left, np.zeros(3), base.gravity, duration))
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
        recommendation=_recommendation(growth, rate, duration),
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


def closed_form(bias: Array, matrix: Array, base: Base, u: Array, rate: float) -> Array:
    """Return the error (3,) in n after one turn about u (3,) in b, by formula.

    Turning averages a vector to its part along u, and a matrix to what commutes with the
    turning, `N_u u u^T + half the rest of its trace (I - u u^T) + its twist about u [u x]`. For
    u = x, y, z on a level base that is R16 table 1.
    """
    along = float(u @ matrix @ u)
    across = 0.5 * (float(np.trace(matrix)) - along)
    twist = 0.5 * float(np.sum(rotation.skew(u) * matrix))
    w_ie_b = base.C_nb.T @ base.w_ie_n
    w_u = float(u @ w_ie_b)
    mean_b = (
        float(u @ bias) * u
        + along * (rate + w_u) * u
        + across * (w_ie_b - w_u * u)
        + twist * np.cross(u, w_ie_b)
    )
    return np.asarray(period(rate) * base.C_nb @ mean_b)


def _nodes(
    bias: Array, matrix: Array, base: Base, u: Array, rate: float
) -> tuple[Array, Array, Array]:
    """Return times (m,), quadrature weights (m,) and the error's rate in n (m, 3) over a turn."""
    x, weight = np.polynomial.legendre.leggauss(_NODES)
    T = period(rate)
    time = 0.5 * T * (x + 1.0)
    C_ns = base.C_nb @ rotation.axis_rotation(u, rate * time)
    w_is_s = base.w_ie_n @ C_ns + rate * u  # rows: C_sn w_ie_n + w u
    errors = (C_ns @ (bias + w_is_s @ matrix.T)[:, :, None])[:, :, 0]
    return time, 0.5 * T * weight, errors


def integrated(bias: Array, matrix: Array, base: Base, u: Array, rate: float) -> Array:
    """Return the error (3,) in n after one turn, the integral of `C_ns (bias + matrix w_is_s)`."""
    _, weight, errors = _nodes(bias, matrix, base, u, rate)
    return np.asarray(weight @ errors)


def ripple(bias: Array, matrix: Array, base: Base, u: Array, rate: float) -> Array:
    """Return the mean (3,) in n, over a turn, of what comes on top of the steady growth.

    A constant error v across u makes `(1 - cos)` and `sin` waves whose mean is `u x v / w`: the
    modulated part stays bounded, but not about zero.
    """
    time, weight, errors = _nodes(bias, matrix, base, u, rate)
    return np.asarray((weight * (0.5 - time / period(rate))) @ errors)


def navigated(
    source: str, bias: Array, matrix: Array, base: Base, u: Array, rate: float
) -> dict[str, Array]:
    """Return the attitude (rad) and velocity (m/s), (3,) each in n, that navigation shows.

    R16 table 1 leaves out that the Earth turns under the errors of the turn so far:
    `dv' = -2 w_ie x dv + eps x f + C_ns b`, `eps' = -w_ie x eps + C_ns (d + N w_is_s)`. Tilt
    within the turn makes velocity; and where the table's entry is itself an error times the Earth
    rate (scale factor across the axis, installation), `-w_ie x eps` is just as large. Left out
    here: the feedback of position (Schuler), some 3e-4 in 36 s, growing as time squared.
    """
    from scipy.linalg import expm

    time, weight, errors = _nodes(bias, matrix, base, u, rate)
    F = np.zeros((6, 6))
    F[:3, :3] = -2.0 * rotation.skew(base.w_ie_n)
    F[:3, 3:] = -rotation.skew(np.array([0.0, 0.0, base.gravity]))
    F[3:, 3:] = -rotation.skew(base.w_ie_n)
    transition = expm(F * (period(rate) - time)[:, None, None])
    driven = transition[:, :, :3] if source == ACCEL_BIAS else transition[:, :, 3:]
    state = weight @ (driven @ errors[:, :, None])[:, :, 0]
    if source == ACCEL_BIAS:  # no attitude error, not even expm's rounding
        state[3:] = 0.0
    return {"attitude": state[3:], "velocity": state[:3]}


def _growth(axis: str, source: str, left: Array, wave: Array, g: float, t: float) -> Growth:
    """Return the growth of a steady error `left` (per s) and a mean `wave`, both (3,) in n."""
    if source == ACCEL_BIAS:  # R16 (26): b t, b t^2 / 2
        return Growth(axis, source, np.zeros(3), left * t, left * t**2 / 2.0, wave, wave * t)

    def tilted(eps: Array) -> Array:  # eps x f, f = (0, 0, g)
        return g * np.array([eps[1], -eps[0], 0.0])

    return Growth(  # R16 (27): g d t^2 / 2, g d t^3 / 6
        axis,
        source,
        left * t,
        tilted(left) * t**2 / 2.0,
        tilted(left) * t**3 / 6.0,
        tilted(wave) * t,
        tilted(wave) * t**2 / 2.0,
    )


def calibration_sigmas(noise: NoiseFigures, time: float, rate: float) -> CalibrationTime:
    """Predict the sigmas of a calibration with `time` (s) for each of its two stretches.

    The sigma of the mean rate is the Allan deviation at that time. White noise falls as
    N / sqrt(T) (R16 (35)); flicker stays at 0.664 B; a rate random walk makes the mean of the
    stretch differ from the value at its end by K sqrt(T / 3), exactly, and so the sigma rises
    again: the trade of R16 section 4. Over the rate it is the sigma of a matrix element (36).
    """
    bias = float(np.sqrt(noise.allan_variance(np.array([time]))[0]))
    white = noise.white / float(np.sqrt(time))
    return CalibrationTime(time, bias, white, bias / abs(rate), white / abs(rate))


def best_calibration_time(noise: NoiseFigures) -> tuple[float | None, bool]:
    """Return the best stretch length (s), and whether the sigma rises again past it.

    With a rate random walk K the minimum lies at sqrt(3) N / K. Without, nothing rises; the time
    at which white noise has fallen to the flicker's floor is returned: the sigma is then sqrt(2)
    of the floor. None without white noise or with nothing against it.
    """
    N, K, floor = noise.white, noise.rate_random_walk, FLICKER_FLOOR * noise.bias_instability
    if N and K:
        return float(np.sqrt(3.0)) * N / K, True
    return ((N / floor) ** 2, False) if N and floor else (None, False)


def _totals(growth: Sequence[Growth]) -> dict[str, Array]:
    """Return the position error (3,) of all sources together, per scheme."""
    total: dict[str, Array] = {}
    for g in growth:
        total[g.axis] = total.get(g.axis, np.zeros(3)) + g.position + g.ripple_position
    return total


def _recommendation(growth: Sequence[Growth], rate: float, duration: float) -> str:
    """Return one sentence: the axis with the smallest horizontal position error, and its price."""
    total = _totals(growth)
    horizontal = {axis: float(np.hypot(p[0], p[1])) for axis, p in total.items()}
    turning = {axis: h for axis, h in horizontal.items() if axis != STILL}
    least = min(turning.values())
    best = [axis for axis, h in turning.items() if h <= least * _EQUAL]
    if max(horizontal.values()) < _NOTHING:
        return "None of these sensor errors makes a horizontal position error: no axis is better."
    others = [f"{h:.3g} m about {axis}" for axis, h in turning.items() if axis not in best]
    others.append(f"{horizontal[STILL]:.3g} m standing still")
    azimuth = sum(g.attitude[2] for g in growth if g.axis == best[0]) / DEG
    useless = least >= horizontal[STILL]
    return (
        f"Turn about {' or '.join(best)} at {rate / DEG:.6g} deg/s: after {duration:g} s these "
        f"sensor errors make {least:.3g} m of horizontal position error, against "
        f"{_listed(others)}; what stays is {abs(total[best[0]][2]):.3g} m of height and "
        f"{abs(azimuth):.3g} deg of azimuth"
        + ("; with so little bias to modulate, not turning is better still." if useless else ".")
    )


def _listed(texts: Sequence[str]) -> str:
    return texts[0] if len(texts) == 1 else ", ".join(texts[:-1]) + " and " + texts[-1]


def _warnings(growth: Sequence[Growth], duration: float) -> tuple[str, ...]:
    found = []
    for axis in dict.fromkeys(g.axis for g in growth):
        tilt = sum((g.attitude for g in growth if g.axis == axis), np.zeros(3))[:2]
        size = float(np.hypot(*tilt))
        if size > _SMALL:
            scheme = "standing still" if axis == STILL else f"turning about {axis}"
            found.append(
                f"{scheme}, the tilt after {duration:g} s comes to {size / DEG:.3g} deg: the "
                "growth is linear in the tilt and overstates what is beyond 6 deg; "
                "take a shorter --duration or calibrated sensors"
            )
    return tuple(found)
