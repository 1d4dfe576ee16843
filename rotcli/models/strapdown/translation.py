"""Velocity and displacement against inertial space, with gravity at the changing position.

The inertial frame i is the Earth-fixed frame e at the block's start. The displacement d from the
starting point of the navigation, which rotates with the Earth, has d'' = f + g(r) + w x (w x d).
Gravity at the block's start is added to f, sample by sample. Its change from there is a straight
line in each group of cells, through the value at the group's mean displacement. A sample instead
of the mean would alias the circle of a lever arm.

Samples have the layout of `cells`; cells, groups and states have (3, m) arrays x, y, z.
"""

from functools import lru_cache

import numpy as np

from rotcli.models import earth
from rotcli.models.strapdown import quadrature
from rotcli.models.strapdown.cells import CELLS, ROWS, Arena, ComplexArray, Vectors, place
from rotcli.models.strapdown.groups import (
    GROUP_SIZES,
    MIN_CELLS,
    Groups,
    Motion,
    earth_velocity,
    follow,
    group_moments,
    rotate,
    running_sum,
    spread,
)
from rotcli.models.strapdown.local_gravity import LocalGravity, dot
from rotcli.units import FloatArray

_SETTLED = 1e-7  # m, bound of the move of the sweep that is not made
_MAX_SWEEPS = 40  # two settle 80 s, eight settle 400 s
_SCHULER_RATE_SQUARED = 9.8 / 6.4e6  # 1/s^2
_MAX_BLOCK_DURATION = 400.0  # s, a twelfth of the Schuler period: the sweeps converge fast
# Multiplications of one matrix product. OpenBLAS starts a second thread for larger products,
# which doubles the CPU time.
_MAX_PRODUCT = 2**18
_BEFORE, _AFTER = 2, 3  # rows that the stencils need before and after a cell


class _Constants:
    """What depends on the interval (s) only: cells, Earth rotation, groups and weights."""

    def __init__(self, interval: float) -> None:
        self.duration = T = ROWS * interval  # of a cell
        self.cells = min(max(int(_MAX_BLOCK_DURATION / T), MIN_CELLS), CELLS)
        n = self.cells + MIN_CELLS
        time = interval * np.arange(ROWS)[:, None] + T * np.arange(n)
        self.earth_rotation: ComplexArray = np.exp(1j * earth.EARTH_RATE * time)
        self.half_rotation: ComplexArray = np.sqrt(self.earth_rotation.conj())  # from i to e
        self.groups = [Groups(size, T, n) for size in GROUP_SIZES]
        # The sweeps converge at least by w^2 T^2 / 12, twice that along the vertical.
        convergence = _SCHULER_RATE_SQUARED * (T * self.cells) ** 2 / 6.0
        self.settled = _SETTLED / min(convergence, 1.0)

        v, d, integral = quadrature.motion_weights(ROWS)
        v, d = interval * v, interval**2 * d
        self.cell_moments = np.stack([v[-1], d[-1], interval**2 / ROWS * integral[-1]])
        t, one = interval * np.arange(ROWS), np.ones(ROWS)
        # A state, and a straight line through a value in the middle, integrated once and twice.
        more_v = np.stack([one, 0.0 * t, t, 0.5 * t * (t - T)], axis=-1)
        more_d = np.stack([t, one, 0.5 * t**2, t**2 * (t / 6.0 - T / 4.0)], axis=-1)
        self.weights = np.concatenate(
            [np.hstack([v[:-1], more_v]), np.hstack([d[:-1], more_d])], axis=0
        )


# A tenth of the time of a log of 5 min; logs of one IMU have the same interval.
_constants = lru_cache(maxsize=8)(_Constants)


class Translation:
    """Integration of the blocks of one log; interval in s."""

    def __init__(self, interval: float, gravity: LocalGravity, *, hold_height: bool) -> None:
        self._gravity, self._hold_height = gravity, hold_height
        constants = _constants(interval)
        self._duration, self.cells = constants.duration, constants.cells
        self.earth_rotation, self._groups = constants.earth_rotation, constants.groups
        self.half_rotation, self._settled = constants.half_rotation, constants.settled
        self._cell_moments, self._weights = constants.cell_moments, constants.weights

    @property
    def input_rows(self) -> int:
        """Rows of the array of `integrate`; `rows_of_force` of it are for the specific force."""
        return int(self._weights.shape[1])

    @staticmethod
    def rows_of_force(rows: Vectors) -> Vectors:
        """Return the rows of the cells' samples, views."""
        return rows[_BEFORE : _BEFORE + ROWS]

    def add_gravity(self, force: Vectors, start: Motion, arena: Arena) -> None:
        """Add the gravity at the block's start to the specific force in i."""
        rows, n = force.polar.shape
        x, y, z = self._gravity.vector + start.reference
        force.polar[...] += z
        with arena.stage():
            in_plane = arena.complex(rows, n)
            np.multiply(self.earth_rotation[:, :n], complex(x, y), out=in_plane)
            force.plane[...] += in_plane

    def integrate(
        self, rows: Vectors, start: Motion, there: int, kept: int, arena: Arena
    ) -> tuple[Vectors, Vectors, Motion]:
        """Return v and d at the samples and the state at the start of cell `kept`.

        rows: `input_rows` rows, with f plus gravity at the block's start. there: samples of the log
        from the block's start on; the rows after them have no meaning.
        """
        n = rows.polar.shape[1]
        self._complete(rows, start, there)
        forces, cells = rows[: ROWS + 5], rows[ROWS + 5 :]
        moments = self._moments(forces, arena)
        groups = self._choose_groups(start)
        time = groups.duration * np.arange(groups.count(n))
        change = start.change[0][:, None] + start.change[1][:, None] * time
        if self._hold_height:
            mean, _ = follow(group_moments(moments, groups), change, start, groups)
            self._remove_vertical(forces, mean, groups, arena)
            moments = self._moments(forces, arena)
        change = self._settle(group_moments(moments, groups), change, start, groups)
        states = self._states(moments, change, start, groups)
        for k, state in enumerate(states):
            cells.put(k, slice(None), state)
        both = arena.vectors(2 * ROWS, n)
        _product(self._weights, rows, both)
        before = self.rows_of_force(rows).at(*place(np.arange(ROWS * kept - 2, ROWS * kept)))
        v, d, *change_and_slope = (state[:, kept] for state in states)
        end = Motion(v, d, start.reference, before, np.array(change_and_slope))
        return both[:ROWS], both[ROWS:], end

    def _moments(self, forces: Vectors, arena: Arena) -> FloatArray:
        """Return the moments (3, 3, n) of the cells: which, component, cell."""
        with arena.stage():
            found = arena.vectors(3, forces.polar.shape[1])
            _product(self._cell_moments, forces, found)
            return np.stack([found.plane.real, found.plane.imag, found.polar], axis=1)

    def _choose_groups(self, start: Motion) -> Groups:
        speed = float(np.linalg.norm(start.v - earth_velocity(start.d[:, None])[:, 0]))
        for groups in self._groups:
            if groups.suits(speed):
                break
        return groups

    def _complete(self, rows: Vectors, start: Motion, there: int) -> None:
        """Fill the rows before and after the cells, and the samples after the end of the log."""
        n = rows.polar.shape[1]
        inside = self.rows_of_force(rows)
        if there < ROWS * n:
            known = np.arange(max(there - 6, 0), there)
            _, following = quadrature.extrapolate(inside.at(*place(known)), 0, _AFTER)
            cell = there // ROWS
            for part in (inside.polar, inside.plane):
                part[:, cell + 1 :] = 0.0
                part[there % ROWS :, cell] = 0.0
            after = np.arange(there, min(there + _AFTER, ROWS * n))
            inside.put(*place(after), following[: len(after)].T)
        before = start.forces
        if before is None:
            known = np.arange(min(6, there))
            before, _ = quadrature.extrapolate(inside.at(*place(known)), _BEFORE, 0)
        head, tail = rows[:_BEFORE], rows[_BEFORE + ROWS : _BEFORE + ROWS + _AFTER]
        for h, i, t in (
            (head.polar, inside.polar, tail.polar),
            (head.plane, inside.plane, tail.plane),
        ):
            h[:, 1:] = i[-_BEFORE:, :-1]
            t[:, :-1] = i[:_AFTER, 1:]
            t[:, -1] = 0.0
        head.put(slice(None), 0, before.T)

    def _settle(
        self, moments: FloatArray, change: FloatArray, start: Motion, groups: Groups
    ) -> FloatArray:
        """Return the change of gravity (3, count) in i, iterated with the displacement."""
        count = change.shape[1]
        to_e, to_i = groups.to_e[:count], groups.to_i[:count]
        reference = start.reference[:, None]
        mean, v = follow(moments, change, start, groups)
        for _ in range(_MAX_SWEEPS):
            d_e = rotate(mean, to_e)
            if self._hold_height:
                v_e = rotate(v, to_e) - earth_velocity(d_e)
                change = rotate(self._gravity.height_hold_change(d_e, v_e, reference), to_i)
            else:
                change = rotate(self._gravity.change(d_e) - reference, to_i)
            before = mean
            mean, v = follow(moments, change, start, groups)
            if np.abs(mean - before).max() < self._settled:
                break
        return change

    def _states(
        self, moments: FloatArray, change: FloatArray, start: Motion, groups: Groups
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return v, d, change of gravity and its slope (3, n) of the cells; change: (3, count)."""
        T = self._duration
        value, slope = spread(change, groups, moments.shape[2])
        v = running_sum(moments[0] + T * value, start.v)
        steps = moments[1] + T * v + (0.5 * T**2) * value - (T**3 / 12.0) * slope
        return v, running_sum(steps, start.d), value, slope

    def _remove_vertical(
        self, forces: Vectors, mean: FloatArray, groups: Groups, arena: Arena
    ) -> None:
        """Remove from the forces their part along the vertical of each cell.

        mean: (3, count) m, displacements of the groups in i.
        """
        count, shape = mean.shape[1], forces.polar.shape
        up_of_groups, _ = self._gravity.vertical(rotate(mean, groups.to_e[:count]))
        up, _ = spread(rotate(up_of_groups, groups.to_i[:count]), groups, shape[1])
        components = (forces.polar, up[2]), (forces.plane.real, up[0]), (forces.plane.imag, up[1])
        with arena.stage():
            vertical, part = (arena.real(*shape) for _ in range(2))
            vertical[...] = 0.0
            for force, direction in components:
                vertical += np.multiply(force, direction, out=part)
            for force, direction in components:
                force -= np.multiply(vertical, direction, out=part)

    def begin_block(self, state: Motion, height: float | None) -> Motion:
        """Return the state with the gravity at its displacement as reference.

        height: m; the state is moved to it, with zero vertical velocity. None: free height.
        """
        d, v = state.d[:, None], state.v[:, None]
        if height is not None:
            up, now = self._gravity.vertical(d)
            d = d - (now - height) * up
            v = v - dot(v - earth_velocity(d), up) * up
        reference = self._gravity.change(d)[:, 0]
        moved = reference - state.reference
        forces = None if state.forces is None else state.forces + moved
        change = state.change - np.stack([moved, np.zeros(3)])
        return Motion(v[:, 0], d[:, 0], reference, forces, change)


def _product(weights: FloatArray, x: Vectors, out: Vectors) -> None:
    """Compute the matrix product out = weights x in column blocks that remain in one thread."""
    columns = _MAX_PRODUCT // weights.size
    for part, result in ((x.polar, out.polar), (x.plane.view(float), out.plane.view(float))):
        for first in range(0, part.shape[1], columns):
            block = slice(first, first + columns)
            np.matmul(weights, part[:, block], out=result[:, block])
