"""Long-run calibration of a single-axis rotation INS: GNSS against the damped mechanization.

The filter (`rotcli.srins.filter`) over a `LevelSolution`, its consistency, and warnings.
Source: the SRINS level-damping paper ("S").
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models import earth
from rotcli.models.kalman import mean_bounds, normalized_squares
from rotcli.srins.filter import FilterSettings, build_filter_model, gain_sequence, run_filter
from rotcli.srins.level_ins import LevelSolution
from rotcli.srins.model import ACCEL_BIAS, GYRO_BIAS, STATES
from rotcli.units import FloatArray

# An estimate may be used if the log has reduced its sigma to this share of the initial one.
MAX_SIGMA_RATIO = 0.25
# Mean square of the innovations over its expectation: beyond it sigmas are 1.4 times too small.
NIS_REJECT_FACTOR = 2.0
# Of the IMU's angle: below it the modulation separates scale factor error and drift.
MIN_MEAN_COSINE = 0.1

_NIS_TOLERANCE = 0.1  # noise figures are known to 5 %
_MAX_REFERENCE_RATIO = 1.5  # of the damping states: beyond it the speed reference is wrong
# m/s^2 over ten seconds: four times the effect of a tilt of 100 arcsec.
_MIN_MANEUVER = 0.02


def step_measurements(
    solution: LevelSolution,
    differences: FloatArray,
    epochs: NDArray[np.int64],
    blocks_per_step: int,
    *,
    damping: bool,
) -> FloatArray:
    """Return z (m, 4 or 8, ...): the mean of INS - GNSS in each step, then u at its end.

    differences: (4, n, ...) summed over the epochs at each block's end.
    """
    per_step, steps = blocks_per_step, len(epochs) // blocks_per_step
    sums = differences[:, : steps * per_step]
    sums = sums.reshape(4, steps, per_step, *differences.shape[2:]).sum(axis=2)
    count = np.maximum(epochs[: steps * per_step].reshape(steps, per_step).sum(axis=1), 1)
    z = sums / count.reshape(1, steps, *[1] * (sums.ndim - 2))
    if damping:
        z = np.concatenate([z, solution.u[:, per_step : steps * per_step + 1 : per_step]])
    return np.moveaxis(z, 1, 0)


@dataclass(frozen=True, eq=False)
class Consistency:
    """Innovations relative to their expectation.

    ratio: mean normalized square over its expectation, 1 for a consistent filter;
    bounds: of the 95 % band of that mean; count: of the scalar measurements.
    """

    ratio: float
    bounds: tuple[float, float]
    count: int

    @property
    def consistent(self) -> bool:
        """Whether the ratio is within the band, or within a tenth of 1: sensors are not ideal."""
        low, high = self.bounds
        return min(low, 1.0 - _NIS_TOLERANCE) <= self.ratio <= max(high, 1.0 + _NIS_TOLERANCE)


@dataclass(frozen=True, eq=False)
class SrinsCalibration:
    """The estimates of the filter.

    time: (m,) s since its start; estimates, sigma (m, 16), SI; observability: (16,)
    1 - sigma(T)/sigma(0), the unit-free degree; gnss, reference: consistency of the GNSS
    innovations and of the measured damping states (None where not measured). maneuvers: (k,) s
    since the filter's start.
    """

    time: FloatArray
    estimates: FloatArray
    sigma: FloatArray
    observability: FloatArray
    gnss: Consistency
    reference: Consistency | None
    maneuvers: FloatArray
    warnings: tuple[str, ...]

    def convergence(self, state: int, levels: FloatArray) -> list[float | None]:
        """Return when sigma of a state falls below each level for good (s), None for never."""
        times: list[float | None] = []
        for level in levels:
            above = np.flatnonzero(self.sigma[:, state] >= level)
            first = 0 if not above.size else int(above[-1]) + 1
            times.append(float(self.time[first]) if first < len(self.time) else None)
        return times


def calibrate(
    solution: LevelSolution,
    differences: FloatArray,
    epochs: NDArray[np.int64],
    block: float,
    settings: FilterSettings,
    *,
    start: float = 0.0,
) -> SrinsCalibration:
    """Estimate drifts and biases over a solution; its first moment is the filter's start.

    differences: (4, n) INS - GNSS `[dV_E, dV_N, d_latitude, d_longitude]` summed over the epochs
    (n,) at the ends of the n blocks of `block` s. start: s on the log's clock, for messages.
    """
    per_step = round(settings.interval / block)
    steps = build_filter_model(
        solution.theta, solution.velocity, solution.latitude, block, settings, epochs
    )
    z = step_measurements(
        solution, differences, epochs, per_step, damping=settings.measured_damping
    )
    sigma0 = settings.initial_sigma(float(solution.latitude[0]))
    gains = gain_sequence(steps, np.diag(sigma0**2))
    estimates, innovations = run_filter(steps, gains, z)
    gnss = _consistency(innovations, gains.S, steps.used, slice(0, 4))
    reference = None
    if settings.measured_damping:
        reference = _consistency(innovations, gains.S, steps.used, slice(4, 8))
    maneuvers, largest = find_maneuvers(solution.velocity, block)
    warnings = [
        *_maneuvers(maneuvers, largest, start),
        *_gaps(epochs, block, start),
        *_inconsistencies(gnss, reference),
    ]
    return SrinsCalibration(
        time=per_step * block * np.arange(1, len(z) + 1, dtype=float),
        estimates=estimates,
        sigma=gains.sigma,
        observability=1.0 - gains.sigma[-1] / sigma0,
        gnss=gnss,
        reference=reference,
        maneuvers=maneuvers,
        warnings=tuple(warnings),
    )


def _consistency(
    innovations: FloatArray, S: FloatArray, used: NDArray[np.bool_], rows: slice
) -> Consistency:
    """Compare the mean normalized square of some rows (m, p) with its expectation."""
    kept = used[:, rows].all(axis=1)
    v, S = innovations[kept, rows], S[kept, rows, rows]
    count = v.size
    if not count:
        return Consistency(1.0, (0.0, np.inf), 0)
    ratio = float(normalized_squares(v, S).sum() / count)
    return Consistency(ratio, mean_bounds(1, count), count)


def _inconsistencies(gnss: Consistency, reference: Consistency | None) -> list[str]:
    warnings = []
    if not gnss.consistent:
        low, high = gnss.bounds
        warnings.append(
            f"GNSS innovations: mean square {gnss.ratio:.4g} times the expected value (95 % band "
            f"{low:.3f} to {high:.3f}); check the noise figures of the rig and of the GNSS"
        )
    if reference is not None and reference.ratio > _MAX_REFERENCE_RATIO:
        warnings.append(
            f"speed reference: damping states scatter {reference.ratio:.1f} times the expected "
            "mean square; check its noise; it may not follow a maneuver"
        )
    return warnings


def find_maneuvers(velocity: FloatArray, block: float) -> tuple[FloatArray, float]:
    """Return when the mean acceleration over ten seconds exceeds that of a cruise, and its maximum.

    velocity: (2, n + 1). Starts (k,) s from the first moment, a minute apart at least; m/s^2.
    """
    lag = max(1, round(10.0 / block))
    if velocity.shape[1] <= lag:
        return np.zeros(0), 0.0
    gain = np.hypot(*(velocity[:, lag:] - velocity[:, :-lag])) / (lag * block)
    fast = np.flatnonzero(gain > _MIN_MANEUVER)
    separate = np.diff(fast, prepend=-np.inf) > 60.0 / block
    starts: FloatArray = block * (fast[separate] + lag).astype(float)
    return starts, float(gain.max())


def _maneuvers(starts: FloatArray, largest: float, start: float) -> list[str]:
    if not starts.size:
        return []
    places = ", ".join(f"{start + moment:.0f} s" for moment in starts[:3])
    more = f" and {starts.size - 3} more" if starts.size > 3 else ""
    return [
        f"maneuver during the run, from {places}{more}: up to {largest:.2g} m/s^2; the drift "
        "estimates overshoot where the speed reference does not follow"
    ]


def _gaps(epochs: NDArray[np.int64], block: float, start: float) -> list[str]:
    """Return a warning about gaps of GNSS that exceed three times the usual spacing."""
    present = np.flatnonzero(epochs)
    if not present.size:
        return ["no GNSS epoch in the run of the filter; the estimates are the initial values"]
    edges = np.concatenate([[-1], present, [len(epochs)]])
    spacing = np.diff(edges)
    usual = float(np.median(np.diff(present))) if present.size > 1 else 1.0
    gaps = np.flatnonzero(spacing > max(3.0 * usual, 10.0 / block))
    if not gaps.size:
        return []
    places = ", ".join(
        f"{start + block * (edges[k] + 2):.0f} s ({block * (spacing[k] - 1):.0f} s)"
        for k in gaps[:3]
    )
    more = f" and {gaps.size - 3} more" if gaps.size > 3 else ""
    return [f"GNSS reference missing from {places}{more}"]


def uncalibrated_drift_error(latitude: float, scale: float, installation: float) -> float:
    """Return the error (rad/s) of the drift along the axis caused by uncalibrated errors.

    scale: factor error of the gyro along the axis; installation: rad, of its input axis. It reads
    `scale W sin L` too much of Earth rate parallel to the axis and `installation W cos L`
    perpendicular to it.
    """
    W = earth.EARTH_RATE
    return float(W * (abs(scale * np.sin(latitude)) + abs(installation * np.cos(latitude))))


def uncalibrated_level_error(latitude: float, scale: float, theta: FloatArray) -> float:
    """Return the error (rad/s) of gyro_bias_y caused by uncalibrated scale factors of x and y.

    theta: (n,) rad, angle of the IMU. The level gyros read `scale W cos L` too much of the north
    component of Earth rate, in n: `s_y cos^2 + s_x sin^2`, always of one sign. A drift of the y
    gyro has the north component `eps_y cos`; so the filter takes for eps_y the mean of the one over
    the mean of the other. Rotation schemes whose mean cosine is 0 separate the two.
    """
    mean = abs(float(np.mean(np.cos(theta))))
    if mean < MIN_MEAN_COSINE:
        return 0.0
    return float(earth.EARTH_RATE * abs(scale * np.cos(latitude)) / mean)


def unreliable_estimates(result: SrinsCalibration, initial: FloatArray) -> dict[str, str]:
    """Return the sensor errors that must not be used, with the reason.

    initial: (16,) initial sigmas, SI.
    """
    reasons: dict[str, str] = {}
    for k in (*range(GYRO_BIAS.start, GYRO_BIAS.stop), *range(ACCEL_BIAS.start, ACCEL_BIAS.stop)):
        ratio = float(result.sigma[-1, k] / initial[k])
        if result.gnss.ratio > NIS_REJECT_FACTOR:
            reasons[STATES[k]] = (
                f"GNSS innovations are {result.gnss.ratio:.3g} times the expected mean square"
            )
        elif ratio > MAX_SIGMA_RATIO:
            reasons[STATES[k]] = f"the log hardly improves it: {ratio:.0%} of its initial sigma"
    return reasons
