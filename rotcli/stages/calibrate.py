"""Calibrate a gyro triad from still and turning stretches (R16 section 3).

Turning at rate w about the unit axis u, a gyro triad reads `w_is + w N u + d`: least squares
gives the bias d and `N u`, the scale factor and installation errors that this axis excites.
R16 is "Rotary Inertial Navigation System Based on MEMS IMU", Sensors 2016, 16, 2017.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import LogError
from rotcli.logs import checks
from rotcli.logs.record import ImuLog, Stretch
from rotcli.models import earth, rotation
from rotcli.models.sensors import FLICKER_FLOOR, TriadErrors, correct
from rotcli.units import show_span

Array = NDArray[np.float64]

BIAS_NAMES = ("bias_x", "bias_y", "bias_z")
# N u in the paper's names: the column of N that a rotation about this axis excites.
COLUMN_NAMES = {
    "x": ("Kgx", "Kgyx", "Kgzx"),
    "y": ("Kgxy", "Kgy", "Kgzy"),
    "z": ("Kgxz", "Kgyz", "Kgz"),
    "u": ("Kgxu", "Kgyu", "Kgzu"),
}


@dataclass(frozen=True, eq=False)
class Base:
    """The still base that Earth rate is compensated for: rad, C_nb (3, 3), gravity m/s^2."""

    latitude: float
    C_nb: Array
    gravity: float = 9.80665


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result of a calibration, SI.

    values: (6,) column of N along the axis (three fractions), then the biases (rad/s);
    covariance (6, 6) in the same order, named by `names`. stretches: those used, still first.
    residual_rms: (3,) rad/s about the model. white: (3,) rad/sqrt(s), the random walk behind the
    covariance. predicted_bias (rad/s), predicted_column (fraction): R16 (35) and (36).
    mean_after: (3,) rad/s, mean corrected gyro of the turning stretches.
    residuals: (m, 3) rad/s with their times (m,), s.
    """

    axis_name: str
    axis: Array
    rate: float
    names: tuple[str, ...]
    values: Array
    covariance: Array
    stretches: tuple[Stretch, ...]
    residual_rms: Array
    white: Array
    predicted_bias: float
    predicted_column: float
    mean_after: Array
    time: Array
    residuals: Array
    warnings: tuple[str, ...]

    @property
    def errors(self) -> TriadErrors:
        """The constant errors found, for `rotcli.models.sensors.correct`."""
        return TriadErrors(np.outer(self.values[:3], self.axis), self.values[3:])


def calibrate(
    imu: ImuLog,
    angle: Array,
    static: Sequence[Stretch],
    rotation_stretches: Sequence[Stretch],
    *,
    axis_name: str,
    axis: Array,
    base: Base | None,
    white: Array | None = None,
    bias_instability: Array | None = None,
) -> Calibration:
    """Estimate biases and the column `N u` of the gyro triad by least squares, R16 (34).

    angle: (n,) rad, table angle at the IMU's times. axis: (3,) u in b (and s). base: None leaves
    Earth rate in the data, as the paper does. white: (3,) rad/sqrt(s), angle random
    walks; None estimates them from the data. bias_instability: (3,) rad/s, B of IEEE Std 952.

    The covariance is that of least squares under white noise, plus one independent share
    0.664 B of bias instability in the mean of each stretch.
    Raises LogError when the stretches cannot separate the unknowns.
    """
    u = np.asarray(axis, dtype=float)
    stretches = (*static, *rotation_stretches)
    if not rotation_stretches:
        raise LogError(imu.path, "no turning stretch to calibrate on; name one with --rotation")
    rates = np.array([stretch.rate for stretch in stretches])
    if np.ptp(rates) < 1e-3 * np.max(np.abs(rates)):
        raise LogError(
            imu.path,
            "one table rate alone cannot tell bias from scale factor; "
            "add a still stretch (--static) or a second rate (--rotation)",
        )
    slices = [imu.within(stretch.start, stretch.end) for stretch in stretches]
    counts = np.array([float(s.stop - s.start) for s in slices])
    reference = [
        _reference(u, stretch.rate, angle[s], base)
        for stretch, s in zip(stretches, slices, strict=True)
    ]
    Z = [imu.gyro[s] - w_ref for s, w_ref in zip(slices, reference, strict=True)]
    means = np.array([z.mean(axis=0) for z in Z])

    # Per gyro axis, unknowns (N u, d): normal equations on stretches weighted by their samples.
    design = np.column_stack([rates, np.ones_like(rates)])
    inverse = np.linalg.inv(design.T @ (counts[:, None] * design))
    gain = inverse @ (design.T * counts)
    column, bias = gain @ means

    residuals = [z - rate * column - bias for z, rate in zip(Z, rates, strict=True)]
    seen = _white_noise(residuals, imu.interval)
    used = seen if white is None else white
    flicker = np.zeros(3) if bias_instability is None else FLICKER_FLOOR * bias_instability
    covariance = np.zeros((6, 6))
    for i in range(3):
        pair = used[i] ** 2 / imu.interval * inverse
        pair = pair + flicker[i] ** 2 * gain @ gain.T
        covariance[np.ix_([i, 3 + i], [i, 3 + i])] = pair
    all_residuals = np.concatenate(residuals)
    turning = [k for k, stretch in enumerate(stretches) if stretch.rate != 0.0]
    found = TriadErrors(np.outer(column, u), bias)
    corrected = np.concatenate([correct(found, imu.gyro[slices[k]]) for k in turning])

    still_time = sum(s.duration for s in stretches if s.rate == 0.0)
    turning_time = sum(stretches[k].duration for k in turning)
    turned = sum(abs(stretches[k].angle) for k in turning)
    typical = float(np.sqrt(np.mean(used**2)))
    return Calibration(
        axis_name=axis_name,
        axis=u,
        rate=rotation_stretches[0].rate,
        names=(*COLUMN_NAMES[axis_name], *BIAS_NAMES),
        values=np.concatenate([column, bias]),
        covariance=covariance,
        stretches=stretches,
        residual_rms=np.sqrt(np.mean(all_residuals**2, axis=0)),
        white=used,
        predicted_bias=typical / np.sqrt(still_time) if still_time else np.inf,
        predicted_column=typical * np.sqrt(turning_time) / turned,
        mean_after=corrected.mean(axis=0),
        time=np.concatenate([imu.time[s] for s in slices]),
        residuals=all_residuals,
        warnings=(
            *_warnings(rotation_stretches, base, seen, white),
            *_gravity_warnings(imu, angle, slices, u, base),
        ),
    )


def _reference(u: Array, rate: float, angle: Array, base: Base | None) -> Array:
    """Return the true rate w_is_s (m, 3) of a stretch: table rate and, with a base, Earth rate."""
    if base is None:
        return np.broadcast_to(rate * u, (len(angle), 3))
    w_ie_b = base.C_nb.T @ earth.earth_rate_n(base.latitude)
    w_ie_s = rotation.turn_about(u, -angle, np.broadcast_to(w_ie_b, (len(angle), 3)))
    return w_ie_s + rate * u


def _white_noise(residuals: list[Array], interval: float) -> Array:
    """Return the random walk (3,), rad/sqrt(s), from differences of neighbouring samples.

    Differences leave out drift and whatever the model does not explain.
    """
    squares = np.concatenate([np.diff(r, axis=0) ** 2 for r in residuals])
    return np.asarray(np.sqrt(0.5 * interval * squares.mean(axis=0)))


def _gravity_warnings(
    imu: ImuLog, angle: Array, slices: Sequence[slice], u: Array, base: Base | None
) -> tuple[str, ...]:
    """Return what gravity says against the attitude that Earth rate is compensated with."""
    if base is None:
        return ()
    forces = [rotation.turn_about(u, angle[s], imu.accel[s]).mean(axis=0) for s in slices]
    expected = base.gravity * base.C_nb[2]
    return checks.check_gravity(imu, np.mean(forces, axis=0), expected, strict=False)


def _warnings(
    rotation_stretches: Sequence[Stretch], base: Base | None, seen: Array, white: Array | None
) -> tuple[str, ...]:
    found = []
    for stretch in rotation_stretches:
        turns = abs(stretch.angle) / (2.0 * np.pi)
        if turns < 1.0:
            leak = "" if base is not None else "; Earth rate then leaks into the biases"
            found.append(
                f"the stretch {show_span(stretch.start, stretch.end)} holds {turns:.2f} of a turn, "
                f"less than one{leak}"
            )
    ratio = 1.0 if white is None or not np.all(white) else float(np.median(seen / white))
    if not 0.5 < ratio < 2.0:
        found.append(
            f"the log's white noise is {ratio:.2g} times the rig's angle_random_walk: "
            "the sigmas below follow the rig"
        )
    return tuple(found)
