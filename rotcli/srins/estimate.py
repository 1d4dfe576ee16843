"""Long-run calibration of a single-axis rotation INS: GNSS against the damped mechanization.

The filter (`rotcli.srins.filter`) over a `LevelSolution`, its consistency, and what a user
must be warned of. Source: the SRINS level-damping paper ("S").
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rotcli.models import earth
from rotcli.models.kalman import mean_bounds, normalized_squares
from rotcli.srins.filter import FilterSettings, build_filter_model, gain_sequence, run_filter
from rotcli.srins.level_ins import LevelSolution

Array = NDArray[np.float64]

_TOLERATED = 0.1  # of the mean normalized square
_MANEUVER = 0.02  # m/s^2 over ten seconds, four times what a tilt of 100 arcsec feigns


def step_measurements(
    solution: LevelSolution,
    differences: Array,
    epochs: NDArray[np.int64],
    per: int,
    *,
    damping: bool,
) -> Array:
    """Return z (m, 4 or 8, ...): the mean of INS - GNSS in each step, then u at its end.

    differences: (4, n, ...) summed over the epochs at each block's end; per: blocks in a step.
    """
    steps = len(epochs) // per
    held = differences[:, : steps * per].reshape(4, steps, per, *differences.shape[2:])
    count = np.maximum(epochs[: steps * per].reshape(steps, per).sum(axis=1), 1)
    z = held.sum(axis=2) / count.reshape(1, steps, *[1] * (held.ndim - 3))
    if damping:
        z = np.concatenate([z, solution.u[:, per : steps * per + 1 : per]])
    return np.moveaxis(z, 1, 0)


@dataclass(frozen=True, eq=False)
class Consistency:
    """Innovations against what the filter expects of them.

    ratio: mean normalized square over its expectation, 1 for a filter that tells the truth;
    bounds: of the 95 % band of that mean; count: of the scalar measurements.
    """

    ratio: float
    bounds: tuple[float, float]
    count: int

    @property
    def sound(self) -> bool:
        """Whether the ratio is within the band, or within a tenth of 1: sensors are not ideal."""
        low, high = self.bounds
        return min(low, 1.0 - _TOLERATED) <= self.ratio <= max(high, 1.0 + _TOLERATED)


@dataclass(frozen=True, eq=False)
class SrinsCalibration:
    """What the filter found.

    time: (m,) s since its start; estimates, sigma (m, 16), SI; observability: (16,)
    1 - sigma(T)/sigma(0), the unit-free degree; gnss, reference: consistency of the GNSS
    innovations and of the measured damping states (None where not measured). maneuvers: (k,) s
    since the filter's start.
    """

    time: Array
    estimates: Array
    sigma: Array
    observability: Array
    gnss: Consistency
    reference: Consistency | None
    maneuvers: Array
    warnings: tuple[str, ...]

    def convergence(self, state: int, levels: Array) -> list[float | None]:
        """Return when sigma of a state falls below each level for good (s), None for never."""
        times: list[float | None] = []
        for level in levels:
            above = np.flatnonzero(self.sigma[:, state] >= level)
            first = 0 if not above.size else int(above[-1]) + 1
            times.append(float(self.time[first]) if first < len(self.time) else None)
        return times


def calibrate(
    solution: LevelSolution,
    differences: Array,
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
    per = round(settings.interval / block)
    steps = build_filter_model(
        solution.theta, solution.velocity, solution.latitude, block, settings, epochs
    )
    z = step_measurements(solution, differences, epochs, per, damping=settings.measured_damping)
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
        time=per * block * np.arange(1, len(z) + 1, dtype=float),
        estimates=estimates,
        sigma=gains.sigma,
        observability=1.0 - gains.sigma[-1] / sigma0,
        gnss=gnss,
        reference=reference,
        maneuvers=maneuvers,
        warnings=tuple(warnings),
    )


def _consistency(innovations: Array, S: Array, used: NDArray[np.bool_], rows: slice) -> Consistency:
    """Judge the innovations of some rows (m, p) by the mean of their normalized squares."""
    kept = used[:, rows].all(axis=1)
    v, S = innovations[kept, rows], S[kept, rows, rows]
    count = v.size
    if not count:
        return Consistency(1.0, (0.0, np.inf), 0)
    ratio = float(normalized_squares(v, S).sum() / count)
    return Consistency(ratio, mean_bounds(1, count), count)


def _inconsistencies(gnss: Consistency, reference: Consistency | None) -> list[str]:
    told = []
    if not gnss.sound:
        told.append(
            f"the filter is not consistent: its GNSS innovations are {gnss.ratio:.4g} times what "
            f"it expects in the mean square (95 % band {gnss.bounds[0]:.3f} to "
            f"{gnss.bounds[1]:.3f}); check the noise figures of the rig and of the GNSS"
        )
    if reference is not None and reference.ratio > 1.5:
        told.append(
            f"the speed reference strays: the damping states scatter {reference.ratio:.1f} times "
            "as expected in the mean square; check its noise, or it did not follow a maneuver"
        )
    return told


def find_maneuvers(velocity: Array, block: float) -> tuple[Array, float]:
    """Return when ten seconds' mean acceleration grew too large for a cruise, and the largest.

    velocity: (2, n + 1). Starts (k,) s from the first moment, a minute apart at least; m/s^2.
    """
    lag = max(1, round(10.0 / block))
    if velocity.shape[1] <= lag:
        return np.zeros(0), 0.0
    gain = np.hypot(*(velocity[:, lag:] - velocity[:, :-lag])) / (lag * block)
    fast = np.flatnonzero(gain > _MANEUVER)
    apart = np.diff(fast, prepend=-np.inf) > 60.0 / block
    starts: Array = block * (fast[apart] + lag).astype(float)
    return starts, float(gain.max())


def _maneuvers(starts: Array, largest: float, start: float) -> list[str]:
    if not starts.size:
        return []
    places = ", ".join(f"{start + moment:.0f} s" for moment in starts[:3])
    more = f" and {starts.size - 3} more" if starts.size > 3 else ""
    return [
        f"maneuver during the run, from {places}{more}: up to {largest:.2g} m/s^2; the drift "
        "estimates overshoot where the speed reference does not follow"
    ]


def _gaps(epochs: NDArray[np.int64], block: float, start: float) -> list[str]:
    """Tell of stretches without GNSS that are longer than three times the usual spacing."""
    there = np.flatnonzero(epochs)
    if not there.size:
        return ["no GNSS epoch in the filter's run: nothing was measured"]
    edges = np.concatenate([[-1], there, [len(epochs)]])
    spacing = np.diff(edges)
    usual = float(np.median(np.diff(there))) if there.size > 1 else 1.0
    gaps = np.flatnonzero(spacing > max(3.0 * usual, 10.0 / block))
    if not gaps.size:
        return []
    places = ", ".join(
        f"{start + block * (edges[k] + 2):.0f} s ({block * (spacing[k] - 1):.0f} s)"
        for k in gaps[:3]
    )
    more = f" and {gaps.size - 3} more" if gaps.size > 3 else ""
    return [f"GNSS reference missing from {places}{more}"]


def expected_bias(latitude: float, scale: float, installation: float) -> float:
    """Return the error (rad/s) of the drift along the axis that other errors leave behind.

    scale: factor error of the axis' gyro; installation: rad, of its input axis. It reads
    `scale W sin L` too much of the Earth's rate along the axis and `installation W cos L` across.
    """
    W = earth.EARTH_RATE
    return float(W * (abs(scale * np.sin(latitude)) + abs(installation * np.cos(latitude))))
