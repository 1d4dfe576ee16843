"""Mechanization of a log block by block, and of a log that arrives chunk by chunk.

Arrays are (n, 3) at this door. Frames: n is East-North-Up, s the sensor's; e is fixed to the
Earth, with its first axis along the Earth's; i is e frozen at the start of each block.
"""

from dataclasses import field

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models import rotation
from rotcli.models.earth import EARTH_RATE
from rotcli.models.strapdown import geography, quadrature
from rotcli.models.strapdown.attitude import attitude, pair_of, rotate_vectors
from rotcli.models.strapdown.cells import (
    AFTER,
    BEFORE,
    ROWS,
    Arena,
    ComplexArray,
    Vectors,
    arena,
    gather,
)
from rotcli.models.strapdown.groups import MIN_CELLS, Motion, earth_velocity
from rotcli.models.strapdown.local_gravity import LocalGravity
from rotcli.models.strapdown.translation import Translation
from rotcli.units import FloatArray

_POINTS = 6  # samples of the polynomial that continues a log


@dataclass(frozen=True, eq=False)
class InitialState:
    """State at the first sample: rad, rad, m, m/s in n, attitude C_ns (3, 3).

    offset_n: (3,) m, position of the sensor from that point (a lever arm), in n.
    """

    latitude: float
    longitude: float
    height: float
    v_n: FloatArray
    C_ns: FloatArray
    offset_n: FloatArray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Position (n,) rad, rad, m; velocity v_n (n, 3) m/s; attitude q_ns (4, n)."""

    latitude: FloatArray
    longitude: FloatArray
    height: FloatArray
    v_n: FloatArray
    q_ns: FloatArray


def mechanize_log(
    w_is_s: FloatArray,
    f_s: FloatArray,
    interval: float,
    start: InitialState,
    *,
    averages: bool = False,
    gravity: float | None = None,
    hold_height: bool = False,
) -> Trajectory:
    """Navigate from angular rate and specific force sampled every `interval` (s).

    w_is_s, f_s: (n, 3), rad/s and m/s^2, at the instants 0, 1, ... n-1; with `averages` the mean
    over the interval that ends there. The start is the state at sample 0. gravity: m/s^2 at the
    start, instead of normal gravity, which then gives only the change with position. hold_height:
    the height remains that of the first sample and the vertical velocity zero.

    A still sensor remains at its place: w = C_sn w_ie, f = C_sn (0, 0, g).
    """
    mechanization = Mechanization(
        interval, start, averages=averages, gravity=gravity, hold_height=hold_height
    )
    return mechanization.advance(w_is_s, f_s, last=True)


class Mechanization:
    """Navigation of a log that arrives chunk by chunk.

    Parameters as for `mechanize_log`. Blocks are counted from the first sample, so the
    trajectories of the chunks, one after the other, are that of the complete log.
    """

    def __init__(
        self,
        interval: float,
        start: InitialState,
        *,
        averages: bool = False,
        gravity: float | None = None,
        hold_height: bool = False,
    ) -> None:
        self._interval, self._averages = interval, averages
        self._longitude = start.longitude
        self._gravity = LocalGravity(start.latitude, start.height, gravity)
        self._translation = Translation(interval, self._gravity, hold_height=hold_height)
        self._rates, self._forces = _Samples(), _Samples()
        self._half_rotation = self._translation.half_rotation
        q_ns = pair_of(rotation.quaternion_from_matrix(start.C_ns))
        self._q_is = geography.attitude_in_i(start.latitude, q_ns)
        d = geography.vector_in_e(start.latitude, start.offset_n)[:, None]
        v_e = geography.vector_in_e(start.latitude, np.asarray(start.v_n, dtype=float))[:, None]
        later, now = self._gravity.change(np.concatenate([d + v_e, d], axis=1)).T  # over 1 s
        change = np.stack([now, later - now])
        self._motion = Motion((v_e + earth_velocity(d))[:, 0], d[:, 0], np.zeros(3), None, change)
        self._height = float(self._gravity.vertical(d)[1][0]) if hold_height else None

    def advance(self, w_is_s: FloatArray, f_s: FloatArray, *, last: bool = False) -> Trajectory:
        """Add the samples (n, 3) that follow; return the trajectory of the blocks they complete.

        The samples of an incomplete block are stored for the next call, unless `last` is set.
        """
        for samples, new in ((self._rates, w_is_s), (self._forces, f_s)):
            samples.append(np.asarray(new, dtype=float), last=last)
        there = self._rates.count
        blocks = self._blocks(there, last=last)
        out = np.empty((10, ROWS * sum(blocks)))
        done = 0
        for kept in blocks:
            size = ROWS * kept
            self._advance_block(kept, there - done, out[:, done : done + size])
            self._rates.drop(size)
            self._forces.drop(size)
            done += size
        self._rates.store()
        self._forces.store()
        out = out[:, :there] if last else out
        out[1] += self._longitude
        if self._height is not None:
            out[2], out[5] = self._height, 0.0
        return Trajectory(out[0], out[1], out[2], out[3:6].T, out[6:])

    def _blocks(self, there: int, *, last: bool) -> list[int]:
        """Return the cells of the blocks that `there` samples are enough for."""
        cells = self._translation.cells
        # One more cell than is kept, and what its stencils need.
        needed = ROWS * (cells + 1) + AFTER
        full = max((there - needed) // (ROWS * cells) + 1, 0)
        rest = there - full * ROWS * cells
        return full * [cells] + ([-(-rest // ROWS)] if last and rest else [])

    def _advance_block(self, kept: int, there: int, out: FloatArray) -> None:
        """Navigate a block of `kept` cells; the log has `there` samples from its start on."""
        n = max(kept + 1, MIN_CELLS)
        start = self._translation.begin_block(self._motion, self._height)
        memory = arena()
        with memory.stage():
            q_is = memory.complex(2, ROWS, n)
            rows = memory.vectors(self._translation.input_rows, n)
            with memory.stage():
                phi = memory.real(3, ROWS, n)
                self._compute_rotation_vectors(phi, memory)
                next_q = attitude(phi, self._q_is, q_is, memory)
            with memory.stage():
                force = self._translation.rows_of_force(rows)
                self._compute_forces(q_is, force, memory)
            self._translation.add_gravity(force, start, memory)
            v, d, end = self._translation.integrate(rows, start, there, kept, memory)
            half = self._half_rotation[:, :n]
            geography.write_solution(d, v, q_is, half, self._gravity, out, memory)
        # The frame i of the next block is e at its start.
        back = np.exp(-0.5j * EARTH_RATE * self._interval * ROWS * kept)
        self._q_is = (complex(next_q[0] * back), complex(next_q[1] * back))
        self._motion = end.rotated(complex(back**2))

    def _compute_rotation_vectors(self, phi: FloatArray, memory: Arena) -> None:
        """Compute the rotation vectors phi (3, ROWS, n), rad, from each sample to the next."""
        _, _, n = phi.shape
        samples = self._rates.block(n, memory)
        if self._averages:
            means, w = memory.real(3, ROWS + 8, n), memory.real(3, ROWS + 3, n)
            gather(samples, 0, means, self._interval)
            quadrature.instants(means, w, memory)
            phi[...] = means[:, 4 : 4 + ROWS]
        else:
            values = memory.real(3, ROWS + 5, n)
            gather(samples, 1, values, self._interval)
            quadrature.step_integrals(values, phi, memory)
            w = values[:, 1:-1]
        quadrature.add_non_commutative_part(phi, w, memory)

    def _compute_forces(self, q_is: ComplexArray, force: Vectors, memory: Arena) -> None:
        """Compute the specific force, m/s^2, in i."""
        n = q_is.shape[2]
        samples = self._forces.block(n, memory)
        f = memory.real(3, ROWS, n)
        if self._averages:
            means = memory.real(3, ROWS + 5, n)
            gather(samples, 1, means, 1.0)
            quadrature.instants(means, f, memory)
        else:
            gather(samples, 3, f, 1.0)
        x, yz = memory.complex(ROWS, n), memory.complex(ROWS, n)
        x.real, x.imag, yz.real, yz.imag = 0.0, f[0], f[1], f[2]
        rotate_vectors(q_is, x, yz, (force.polar, force.plane), memory)


class _Samples:
    """Samples (n, 3) of one triad from the next block's start on, with some before it."""

    def __init__(self) -> None:
        self._pieces: list[FloatArray] = [np.empty((0, 3))]
        self._before = 0  # rows of the pieces before the next block's start
        self.count = 0  # samples of the log from the next block's start on

    def append(self, new: FloatArray, *, last: bool) -> None:
        """Add the samples that follow; at its two ends the log continues as a polynomial."""
        self._pieces = [*self._pieces, new]
        self.count += len(new)
        if not self._before and (self.count >= _POINTS or (last and self.count)):
            head, _ = quadrature.extrapolate(self._rows(0, min(self.count, _POINTS)), BEFORE, 0)
            self._pieces = [head, *self._pieces]
            self._before = BEFORE
        if last and self.count:
            known = min(self.count + self._before, _POINTS)
            known = min(known, self.count) if self.count < known else known
            end = self._before + self.count
            _, tail = quadrature.extrapolate(self._rows(end - known, known), 0, AFTER)
            self._pieces.append(tail)

    def block(self, cells: int, memory: Arena) -> FloatArray:
        """Return the samples of a block of cells, BEFORE samples before it and AFTER behind it."""
        count = BEFORE + ROWS * cells + AFTER
        return self._rows(self._before - BEFORE, count, memory.real(count, 3))

    def drop(self, samples: int) -> None:
        """Move the start of the next block by some samples."""
        self._before += samples
        self.count -= samples

    def store(self) -> None:
        """Copy the samples that the next blocks need, so that the chunk can be released."""
        first = max(self._before - BEFORE, 0)
        self._pieces = [self._rows(first, self._before - first + max(self.count, 0)).copy()]
        self._before -= first

    def _rows(self, first: int, count: int, result: FloatArray | None = None) -> FloatArray:
        """Return rows of the pieces, one after the other; zeros after the last one.

        result: (count, 3), where they are put together if they are not of one piece.
        """
        start = 0
        for piece in self._pieces:
            if start <= first and first + count <= start + len(piece):
                return piece[first - start : first - start + count]
            start += len(piece)
        result = np.empty((count, 3)) if result is None else result
        start = 0
        for piece in self._pieces:
            a, b = max(first, start), min(first + count, start + len(piece))
            if a < b:
                result[a - first : b - first] = piece[a - start : b - start]
            start += len(piece)
        result[max(start - first, 0) :] = 0.0
        return result
