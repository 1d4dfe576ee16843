"""Groups of cells, in which the change of gravity with the position is a straight line.

Gravity needs the displacement, which is the double integral of the acceleration. The moments of
the acceleration in each cell, and their sums over groups of cells, contain all that is needed.
States and values of groups and cells are (3, m) arrays x, y, z.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models import earth
from rotcli.models.strapdown.cells import ComplexArray
from rotcli.units import FloatArray

MIN_CELLS = 3  # the slope of the gravity change is a difference of groups
# Cells of a group, its duration in s and its length in m. Gravity changes with the Schuler period
# of 5000 s, so a straight line over 2 s has an error of 1e-11 of its effect. Over 20 m the mean of
# gravity differs from gravity at the mean by 3e-11 m/s^2. A cell of a log below 16 Hz lasts longer
# and is a group of its own: at 1 Hz (32 s) a sensor that goes 400 m in 200 s is off by 0.5 mm.
GROUP_SIZES, _MAX_DURATION, _MAX_LENGTH = (8, 4, 2, 1), 2.0, 20.0


@dataclass(frozen=True, eq=False)
class Motion:
    """State at a sample, in i: velocity v (3,) m/s and displacement d (3,) m.

    reference: (3,) m/s^2, the change of gravity (`LocalGravity.change`) at the block's start.
    forces: (2, 3) m/s^2, f plus gravity at the block's start, at the two samples before; None at
    the first sample. change: (2, 3), further change of gravity in m/s^2, and its slope in m/s^3.
    """

    v: FloatArray
    d: FloatArray
    reference: FloatArray
    forces: FloatArray | None
    change: FloatArray

    def rotated(self, factor: complex) -> "Motion":
        """Return the state in a frame whose equatorial components are `factor` times these.

        The reference is fixed to the Earth and has the same components in the next frame i.
        """
        v, d = (rotate(x[:, None], factor)[:, 0] for x in (self.v, self.d))
        forces = None if self.forces is None else rotate(self.forces.T, factor).T
        return Motion(v, d, self.reference, forces, rotate(self.change.T, factor).T)


class Groups:
    """Groups of `size` cells of a duration (s), enough for a number of cells."""

    def __init__(self, size: int, cell_duration: float, cells: int) -> None:
        self.size, self.duration = size, size * cell_duration
        self.weights = _group_weights(size, cell_duration)
        # From the middle of each cell to that of its group.
        self.offset = cell_duration * (np.arange(size) - 0.5 * (size - 1))
        middle = self.duration * (np.arange(self.count(cells)) + 0.5)
        self.to_i: ComplexArray = np.exp(1j * earth.EARTH_RATE * middle)
        self.to_e = self.to_i.conj()

    def suits(self, speed: float) -> bool:
        """Return whether the groups are short enough for a speed (m/s)."""
        return self.duration <= _MAX_DURATION and speed * self.duration <= _MAX_LENGTH

    def count(self, cells: int) -> int:
        """Return the number of groups that contain the cells."""
        return max(-(-cells // self.size), MIN_CELLS)


def earth_velocity(d: FloatArray) -> FloatArray:
    """Return w x d (3, m), m/s, of displacements d (3, m), m."""
    velocity = np.zeros_like(d)
    velocity[0], velocity[1] = -earth.EARTH_RATE * d[1], earth.EARTH_RATE * d[0]
    return velocity


def rotate(x: FloatArray, factor: ComplexArray | complex) -> FloatArray:
    """Return vectors (3, m) rotated about the Earth's axis by a complex factor."""
    in_plane = (x[0] + 1j * x[1]) * factor
    result = np.empty_like(x)
    result[0], result[1], result[2] = in_plane.real, in_plane.imag, x[2]
    return result


def group_moments(moments: FloatArray, groups: Groups) -> FloatArray:
    """Return the moments (3, 3, count) of groups of cells from those of cells (3, 3, n)."""
    n = moments.shape[2]
    count = groups.count(n)
    cells = np.zeros((3, 3, count * groups.size))
    cells[:, :, :n] = moments
    by_group = cells.reshape(3, 3, count, groups.size)
    grouped: FloatArray = np.einsum("abj,bkgj->akg", groups.weights, by_group)
    return grouped


def follow(
    moments: FloatArray, change: FloatArray, start: Motion, groups: Groups
) -> tuple[FloatArray, FloatArray]:
    """Return mean displacement and mean velocity of the groups, (3, count), in i."""
    T = groups.duration
    slope = _slope(change, T)
    v = running_sum(moments[0] + T * change, start.v)
    steps = moments[1] + T * (v + (0.5 * T) * change - (T**2 / 12.0) * slope)
    d = running_sum(steps, start.d)
    mean = d + moments[2] + T * (0.5 * v + (T / 6.0) * change - (T**2 / 24.0) * slope)
    return mean, steps / T


def spread(x: FloatArray, groups: Groups, n: int) -> tuple[FloatArray, FloatArray]:
    """Return values and slopes (3, n) in the middle of n cells from values x (3, count)."""
    slopes = _slope(x, groups.duration)
    values = (x[:, :, None] + groups.offset * slopes[:, :, None]).reshape(3, -1)
    return values[:, :n], np.repeat(slopes, groups.size, axis=1)[:, :n]


def running_sum(x: FloatArray, first: FloatArray) -> FloatArray:
    """Return the sums of x (3, m) over the columns before, plus first (3,)."""
    total = np.empty_like(x)
    total[:, 0], total[:, 1:] = first, x[:, :-1]
    return np.add.accumulate(total, axis=1, out=total)


def _slope(x: FloatArray, duration: float) -> FloatArray:
    """Return the slopes of values x (3, groups): of parabolas through three of them."""
    slope = np.empty_like(x)
    np.subtract(x[:, 2:], x[:, :-2], out=slope[:, 1:-1])
    slope[:, 0] = 4.0 * x[:, 1] - 3.0 * x[:, 0] - x[:, 2]
    slope[:, -1] = 3.0 * x[:, -1] - 4.0 * x[:, -2] + x[:, -3]
    slope *= 0.5 / duration
    return slope


def _group_weights(size: int, duration: float) -> FloatArray:
    """Return the weights (3, 3, size) of the moments of cells in the moments of their group.

    Moments are the integral of the acceleration, its double integral, and the mean of the double
    integral over the cell, each from the cell's start.
    """
    later = np.arange(size - 1.0, -1.0, -1.0)  # cells of the group that follow
    weights = np.zeros((3, 3, size))
    weights[0, 0] = weights[1, 1] = 1.0
    weights[1, 0] = duration * later
    weights[2, 0] = duration * later**2 / (2.0 * size)
    weights[2, 1], weights[2, 2] = later / size, 1.0 / size
    return weights
