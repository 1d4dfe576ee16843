"""Readings onto an even clock: gaps filled, or literal stamps interpolated."""

import numpy as np
from numpy.typing import NDArray

from rotcli.logs.timing.line import SampleClock
from rotcli.units import FloatArray


def fill_gaps(values: FloatArray, line: SampleClock) -> tuple[FloatArray, NDArray[np.bool_] | None]:
    """Put values (k, n) in their slots of the even clock, (k, count); lost ones by straight line.

    Also returns which samples were lost, or None when none was.
    """
    if line.count == values.shape[1]:
        return values, None
    missing = np.ones(line.count, dtype=bool)
    missing[line.slots] = False
    holes = np.flatnonzero(missing)
    result = np.empty((len(values), line.count))
    for row, out in zip(values, result, strict=True):
        out[line.slots] = row
        out[holes] = np.interp(holes, line.slots, row)
    return result, missing


def resample(
    time: FloatArray,
    values: FloatArray,
    line: SampleClock,
    *,
    averages: bool,
    grid: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_] | None]:
    """Interpolate values (k, n) stamped at time (n,) onto an even grid from the first stamp.

    line: its interval, and its index for the gaps (of `fit_sample_clock` or `clock_from_stamps`).
    Four-point (cubic) Lagrange interpolation: of the values when they are instants, of their
    running integral when each is the mean since the sample before. Inside gaps: straight lines.
    grid: (m,) s, in place of all that fit between the first stamp and the last.
    Returns the grid times (m,), the values (k, m), and which are inside gaps or None.
    """
    dt = line.interval
    if grid is None:
        grid = time[0] + dt * np.arange(int((time[-1] - time[0]) / dt + 1e-9) + 1, dtype=float)
    holed = np.diff(line.slots) > 1
    after = np.minimum(np.searchsorted(time, grid, side="left"), len(time) - 1)
    missing = np.append(False, holed)[after]
    missing &= (time[after] - grid > 0.5 * dt) & (grid - time[after - 1] > 0.5 * dt)
    if averages:
        sums = np.zeros((len(values), len(time) + 1))
        width = np.append(dt, np.where(holed, dt, np.diff(time)))
        parts = values * width
        between = 0.5 * (values[:, 1:] + values[:, :-1]) * (np.diff(time) - width[1:])
        parts[:, 1:] += between  # nothing except for the gaps
        np.cumsum(parts, axis=1, out=sums[:, 1:])
        edges = np.append(grid[0] - dt, grid)
        result = np.diff(interpolate(np.append(time[0] - dt, time), sums, edges)) / dt
    else:
        result = interpolate(time, values, grid)
        for row, out in zip(values, result, strict=True):
            out[missing] = np.interp(grid[missing], time, row)
    return grid, result, missing if missing.any() else None


def interpolate(x: FloatArray, y: FloatArray, at: FloatArray) -> FloatArray:
    """Interpolate y (k, n) at nodes x (n,) cubically to `at` (m,): (k, m)."""
    if len(x) < 4:
        return np.stack([np.interp(at, x, row) for row in y])
    first = np.clip(np.searchsorted(x, at) - 2, 0, len(x) - 4)
    nodes = [x[first + i] for i in range(4)]
    result = np.zeros((len(y), len(at)))
    for i in range(4):
        weight = np.ones(len(at))
        for j in range(4):
            if j != i:
                weight *= (at - nodes[j]) / (nodes[i] - nodes[j])
        result += weight * y[:, first + i]
    return result
