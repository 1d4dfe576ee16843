"""Velocity and displacement against inertial space, with gravity at the changing position.

The inertial frame i is the Earth-fixed frame e at the block's start. The displacement d from the
starting point of the navigation, which rotates with the Earth, has d'' = f + g(r) + w x (w x d).
The gravity of the starting point is added to f, sample by sample. Its change with d is a straight
line in each group of cells, through the value at the group's mean displacement. A sample instead
of the mean would alias the circle of a lever arm.

Samples and cells have the layout of `cells`; groups and states have (3, m) arrays x, y, z.
"""

from dataclasses import dataclass

import numpy as np

from rotcli.models import earth
from rotcli.models.strapdown import quadrature
from rotcli.models.strapdown.cells import CELLS, ROWS, Arena, ComplexArray, entries, plane, polar
from rotcli.models.strapdown.local_gravity import LocalGravity, dot
from rotcli.units import FloatArray

_SETTLED = 1e-7  # m, bound of the move of the sweep that is not made
_MAX_SWEEPS = 40  # two settle 80 s, eight settle 400 s
_SCHULER_RATE_SQUARED = 9.8 / 6.4e6  # 1/s^2
_MAX_BLOCK_DURATION = 400.0  # s, a twelfth of the Schuler period: the sweeps converge fast
MIN_CELLS = 3  # the slope of the gravity change is a difference of groups
# Cells of a group, and its duration in s: gravity changes with the Schuler period of 5000 s, so
# a straight line over 2 s has an error of 1e-11 of its effect.
_GROUP, _MAX_GROUP_DURATION = 8, 2.0
# Multiplications of one matrix product. OpenBLAS starts a second thread for larger products,
# which doubles the CPU time.
_MAX_PRODUCT = 2**18
_BEFORE, _AFTER = 2, 3  # rows that the stencils need before and after a cell


@dataclass(frozen=True, eq=False)
class Motion:
    """State at a sample, in i: velocity v (3,) m/s and displacement d (3,) m.

    forces: (2, 3) m/s^2, f plus the start's gravity at the two samples before, None at the start.
    change: (2, 3), change of gravity in m/s^2, and its slope in m/s^3.
    """

    v: FloatArray
    d: FloatArray
    forces: FloatArray | None
    change: FloatArray

    def rotated(self, factor: complex) -> "Motion":
        """Return the state in a frame whose equatorial components are `factor` times these."""
        v, d = (_rotate(x[:, None], factor)[:, 0] for x in (self.v, self.d))
        forces = None if self.forces is None else _rotate(self.forces.T, factor).T
        return Motion(v, d, forces, _rotate(self.change.T, factor).T)


class Translation:
    """Integration of the blocks of one log; interval in s."""

    def __init__(self, interval: float, gravity: LocalGravity, *, hold_height: bool) -> None:
        self._gravity, self._hold_height = gravity, hold_height
        self._duration = T = ROWS * interval  # of a cell
        self._group = min(max(int(_MAX_GROUP_DURATION / T), 1), _GROUP)
        self._group_duration = self._group * T
        limit = int(_MAX_BLOCK_DURATION / T)
        self.cells = min(max(limit, MIN_CELLS * self._group), CELLS)
        n = self.cells + MIN_CELLS
        time = interval * np.arange(ROWS)[:, None] + T * np.arange(n)
        self.earth_rotation: ComplexArray = np.exp(1j * earth.EARTH_RATE * time)
        middle = self._group_duration * (np.arange(-(-n // self._group) + MIN_CELLS) + 0.5)
        self._to_i: ComplexArray = np.exp(1j * earth.EARTH_RATE * middle)
        self._to_e = self._to_i.conj()
        # The sweeps converge at least by w^2 T^2 / 12, twice that along the vertical.
        convergence = _SCHULER_RATE_SQUARED * (T * self.cells) ** 2 / 6.0
        self._settled = _SETTLED / min(convergence, 1.0)

        v, d, integral = quadrature.motion_weights(ROWS)
        v, d = interval * v, interval**2 * d
        self._cell_moments = np.stack([v[-1], d[-1], interval**2 / ROWS * integral[-1]])
        self._group_moments = _group_weights(self._group, T)
        t, one = interval * np.arange(ROWS), np.ones(ROWS)
        # A state, and a straight line through a value in the middle, integrated once and twice.
        more_v = np.stack([one, 0.0 * t, t, 0.5 * t * (t - T)], axis=-1)
        more_d = np.stack([t, one, 0.5 * t**2, t**2 * (t / 6.0 - T / 4.0)], axis=-1)
        self._weights = np.concatenate(
            [np.hstack([v[:-1], more_v]), np.hstack([d[:-1], more_d])], axis=0
        )

    def input_rows(self, n: int, arena: Arena) -> FloatArray:
        """Return an array (ROWS + 9, 3n); `rows_of_force` of it are for the specific force in i."""
        return arena.real(self._weights.shape[1], 3 * n)

    @staticmethod
    def rows_of_force(rows: FloatArray) -> FloatArray:
        """Return the view (ROWS, 3n) of the cells' samples."""
        return rows[_BEFORE : _BEFORE + ROWS]

    def add_gravity(self, force: FloatArray) -> None:
        """Add the gravity at the start to the specific force (ROWS, 3n) in i."""
        n = force.shape[1] // 3
        x, _, z = self._gravity.vector
        force_polar, force_plane = polar(force), plane(force)
        force_polar += z
        force_plane += x * self.earth_rotation[:, :n]

    def integrate(
        self, rows: FloatArray, start: Motion, there: int, kept: int, arena: Arena
    ) -> tuple[FloatArray, FloatArray, Motion]:
        """Return v and d (ROWS, 3n) at the samples and the state at the start of cell `kept`.

        rows: from `input_rows`, with f plus the start's gravity. there: samples of the log from
        the block's start on; the rows after them have no meaning.
        """
        n = rows.shape[1] // 3
        self._complete(rows, start, there)
        forces, cells = rows[: ROWS + 5], rows[ROWS + 5 :]
        moments = np.empty((3, 3 * n))
        _product(self._cell_moments, forces, moments)
        groups = max(-(-n // self._group), MIN_CELLS)
        time = self._group_duration * np.arange(groups)
        change = start.change[0][:, None] + start.change[1][:, None] * time
        if self._hold_height:
            mean, _ = self._follow(self._grouped(moments, groups), change, start)
            self._remove_vertical(forces, mean, arena)
            _product(self._cell_moments, forces, moments)
        change = self._settle(self._grouped(moments, groups), change, start)
        self._fill_states(moments, change, start, cells)
        both = arena.real(2 * ROWS, 3 * n)
        _product(self._weights, rows, both)
        _, columns = entries(np.array([ROWS * kept]), n)
        v, d, *change_and_slope = cells[:, columns[0]]
        before = entries(np.arange(ROWS * kept - 2, ROWS * kept), n)
        end = Motion(v, d, self.rows_of_force(rows)[before], np.array(change_and_slope))
        return both[:ROWS], both[ROWS:], end

    def _complete(self, rows: FloatArray, start: Motion, there: int) -> None:
        """Fill the rows before and after the cells, and the samples after the end of the log."""
        n = rows.shape[1] // 3
        inside = self.rows_of_force(rows)
        if there < ROWS * n:
            known = np.arange(max(there - 6, 0), there)
            _, following = quadrature.extrapolate(inside[entries(known, n)], 0, _AFTER)
            cell = there // ROWS
            for part in (polar(inside), plane(inside)):
                part[:, cell + 1 :] = 0.0
                part[there % ROWS :, cell] = 0.0
            after = np.arange(there, min(there + _AFTER, ROWS * n))
            inside[entries(after, n)] = following[: len(after)]
        before = start.forces
        if before is None:
            known = np.arange(min(6, there))
            before, _ = quadrature.extrapolate(inside[entries(known, n)], _BEFORE, 0)
        head, tail = rows[:_BEFORE], rows[_BEFORE + ROWS : _BEFORE + ROWS + _AFTER]
        for part in (polar, plane):
            part(head)[:, 1:] = part(inside)[-_BEFORE:, :-1]
            part(tail)[:, :-1] = part(inside)[:_AFTER, 1:]
            part(tail)[:, -1] = 0.0
        polar(head)[:, 0] = before[:, 2]
        plane(head)[:, 0] = before[:, 0] + 1j * before[:, 1]

    def _grouped(self, moments: FloatArray, groups: int) -> FloatArray:
        """Return the moments (3, 3, groups) of groups of cells from those of cells (3, 3n)."""
        n = moments.shape[1] // 3
        cells = np.zeros((3, 3, groups * self._group))
        in_plane = plane(moments)
        cells[:, 0, :n], cells[:, 1, :n], cells[:, 2, :n] = (
            in_plane.real,
            in_plane.imag,
            polar(moments),
        )
        by_group = cells.reshape(3, 3, groups, self._group)
        grouped: FloatArray = np.einsum("abj,bkgj->akg", self._group_moments, by_group)
        return grouped

    def _settle(self, moments: FloatArray, change: FloatArray, start: Motion) -> FloatArray:
        """Return the change of gravity (3, groups) in i, iterated with the displacement."""
        groups = change.shape[1]
        to_e, to_i = self._to_e[:groups], self._to_i[:groups]
        mean, v = self._follow(moments, change, start)
        for _ in range(_MAX_SWEEPS):
            d_e = _rotate(mean, to_e)
            if self._hold_height:
                v_e = _rotate(v, to_e) - earth_velocity(d_e)
                change = _rotate(self._gravity.height_hold_change(d_e, v_e), to_i)
            else:
                change = _rotate(self._gravity.change(d_e), to_i)
            before = mean
            mean, v = self._follow(moments, change, start)
            if np.abs(mean - before).max() < self._settled:
                break
        return change

    def _follow(
        self, moments: FloatArray, change: FloatArray, start: Motion
    ) -> tuple[FloatArray, FloatArray]:
        """Return mean displacement and mean velocity of the groups, (3, groups), in i."""
        T = self._group_duration
        slope = _slope(change, T)
        v = _running_sum(moments[0] + T * change, start.v)
        steps = moments[1] + T * (v + (0.5 * T) * change - (T**2 / 12.0) * slope)
        d = _running_sum(steps, start.d)
        mean = d + moments[2] + T * (0.5 * v + (T / 6.0) * change - (T**2 / 24.0) * slope)
        return mean, steps / T

    def _fill_states(
        self, moments: FloatArray, change: FloatArray, start: Motion, cells: FloatArray
    ) -> None:
        """Write v, d, change of gravity and its slope of the cells (4, 3n); change: (3, groups)."""
        T = self._duration
        v, d, value, slope = cells
        self._spread(change, value, slope)
        _running_sum_of_cells(moments[0] + T * value, start.v, v)
        steps = moments[1] + T * v + (0.5 * T**2) * value - (T**3 / 12.0) * slope
        _running_sum_of_cells(steps, start.d, d)

    def _spread(self, x: FloatArray, value: FloatArray, slope: FloatArray) -> None:
        """Write values and slopes (3n,) in the middle of the cells from values x (3, groups)."""
        offset = self._duration * (np.arange(self._group) - 0.5 * (self._group - 1))
        slopes = _slope(x, self._group_duration)[:, :, None]
        values = (x[:, :, None] + offset * slopes).reshape(3, -1)
        for rows, out in ((values, value), (np.repeat(slopes, self._group).reshape(3, -1), slope)):
            n = out.size // 3
            polar(out)[...] = rows[2, :n]
            plane(out).real, plane(out).imag = rows[0, :n], rows[1, :n]

    def _remove_vertical(self, forces: FloatArray, mean: FloatArray, arena: Arena) -> None:
        """Remove from the forces (rows, 3n) their part along the vertical of each cell.

        mean: (3, groups) m, where the groups of cells are.
        """
        groups, n = mean.shape[1], forces.shape[1] // 3
        up_of_groups, _ = self._gravity.vertical(_rotate(mean, self._to_e[:groups]))
        up, slope = np.empty(3 * n), np.empty(3 * n)
        self._spread(_rotate(up_of_groups, self._to_i[:groups]), up, slope)
        force_polar, force_plane = polar(forces), plane(forces)
        with arena.stage():
            vertical, part = (arena.real(*force_polar.shape) for _ in range(2))
            components = (
                (force_polar, polar(up)),
                (force_plane.real, plane(up).real),
                (force_plane.imag, plane(up).imag),
            )
            vertical[...] = 0.0
            for force, direction in components:
                vertical += np.multiply(force, direction, out=part)
            for force, direction in components:
                force -= np.multiply(vertical, direction, out=part)

    def project(self, state: Motion, height: float) -> Motion:
        """Return a state at a block's start moved to a height, with zero vertical velocity."""
        d, v = state.d[:, None], state.v[:, None]
        up, now = self._gravity.vertical(d)
        d = d - (now - height) * up
        v = v - dot(v - earth_velocity(d), up) * up
        return Motion(v[:, 0], d[:, 0], state.forces, state.change)


def earth_velocity(d: FloatArray) -> FloatArray:
    """Return w x d (3, m), m/s, of displacements d (3, m), m."""
    return earth.EARTH_RATE * np.stack([-d[1], d[0], np.zeros_like(d[2])])


def _rotate(x: FloatArray, factor: ComplexArray | complex) -> FloatArray:
    """Return vectors (3, m) rotated about the Earth's axis by a complex factor."""
    in_plane = (x[0] + 1j * x[1]) * factor
    result = np.empty_like(x)
    result[0], result[1], result[2] = in_plane.real, in_plane.imag, x[2]
    return result


def _slope(x: FloatArray, duration: float) -> FloatArray:
    """Return the slopes of values x (3, groups): of parabolas through three of them."""
    slope = np.empty_like(x)
    np.subtract(x[:, 2:], x[:, :-2], out=slope[:, 1:-1])
    slope[:, 0] = 4.0 * x[:, 1] - 3.0 * x[:, 0] - x[:, 2]
    slope[:, -1] = 3.0 * x[:, -1] - 4.0 * x[:, -2] + x[:, -3]
    slope *= 0.5 / duration
    return slope


def _running_sum(x: FloatArray, first: FloatArray) -> FloatArray:
    """Return the sums of x (3, m) over the columns before, plus first (3,)."""
    total = np.empty_like(x)
    total[:, 0], total[:, 1:] = first, x[:, :-1]
    return np.add.accumulate(total, axis=1, out=total)


def _running_sum_of_cells(x: FloatArray, first: FloatArray, out: FloatArray) -> None:
    """Write `_running_sum` of x (3n,) to out (3n,)."""
    along, across = polar(out), plane(out)
    along[0], along[1:] = first[2], polar(x)[:-1]
    across[0], across[1:] = complex(first[0], first[1]), plane(x)[:-1]
    for total in (along, across):
        np.add.accumulate(total, out=total)


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


def _product(weights: FloatArray, x: FloatArray, out: FloatArray) -> None:
    """Compute the matrix product out = weights x in column blocks that remain in one thread."""
    columns = _MAX_PRODUCT // weights.size
    for first in range(0, x.shape[1], columns):
        block = slice(first, first + columns)
        np.matmul(weights, x[:, block], out=out[:, block])
