"""Layout of a block of samples in cells, and the memory that all blocks share.

A block has n cells of ROWS samples, sample = ROWS * cell + row. The last axes of every array are
(row, cell): the next sample is the next row, a recursion over time runs over ROWS rows of n
numbers, and a constant of a cell applies to all its rows.

Every component of a vector or quaternion is an array of its own that starts at a cache line:
arithmetic on contiguous and aligned arrays takes about half the time.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from math import prod

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.units import FloatArray

ComplexArray = NDArray[np.complex128]
Index = int | slice | NDArray[np.intp]

ROWS = 32  # samples of a cell
CELLS = 512  # cells of a full block; more leave the cache, fewer are slow because of the calls
# Samples that the stencils need before and after the block's cells: means need the most.
BEFORE, AFTER = 3, 5
_ARENA_SIZE = 64 * ROWS * (CELLS + 4)  # doubles; the stages of a block need less than 50 arrays
_LINE = 8  # doubles of a cache line; arithmetic on arrays that start at one is twice as fast


@dataclass(frozen=True, eq=False)
class Vectors:
    """Vectors in space, (rows, n): polar components, along the Earth's axis, and equatorial ones.

    The two equatorial components x, y are a complex number x + iy, so that a rotation about the
    Earth's axis is a complex factor.
    """

    polar: FloatArray
    plane: ComplexArray

    def __getitem__(self, index: int | slice) -> "Vectors":
        """Return some rows, views."""
        return Vectors(self.polar[index], self.plane[index])

    def at(self, row: Index, cell: Index) -> FloatArray:
        """Return the components x, y, z (k, 3) at rows and cells (k,)."""
        in_plane = self.plane[row, cell]
        return np.stack([in_plane.real, in_plane.imag, self.polar[row, cell]], axis=-1)

    def put(self, row: Index, cell: Index, x: FloatArray) -> None:
        """Set the components x, y, z (..., k) at rows and cells."""
        self.plane[row, cell] = x[0] + 1j * x[1]
        self.polar[row, cell] = x[2]


def gather(x: FloatArray, first: int, out: FloatArray, scale: float) -> None:
    """Copy samples x (m, 3) times a scale to out (3, rows, n); rows may overlap the next cells.

    first: the sample in row 0 of cell 0.
    """
    step, component = x.strides
    view = np.lib.stride_tricks.as_strided(
        x[first:], out.shape, (component, step, ROWS * step), writeable=False
    )
    np.multiply(view, scale, out=out)


def scatter(x: FloatArray, out: FloatArray, offset: FloatArray | None = None) -> None:
    """Copy cells x (ROWS, n) plus an offset (n,) to the samples out (ROWS * kept,), by time."""
    kept = len(out) // ROWS
    samples = out.reshape(kept, ROWS)
    if offset is None:
        samples[...] = x[:, :kept].T
    else:
        np.add(x[:, :kept].T, offset[:kept, None], out=samples)


def place(samples: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the rows and cells of samples."""
    return samples % ROWS, samples // ROWS


class Arena:
    """Memory for the intermediate arrays of one block, used again by the next block.

    New pages cost more than the arithmetic on them, so the arrays are not allocated per block.
    """

    def __init__(self) -> None:
        store = np.empty(_ARENA_SIZE + _LINE)
        self._store = store[-(store.ctypes.data // store.itemsize) % _LINE :]
        self._used = 0

    def real(self, *shape: int) -> FloatArray:
        """Return an uninitialized real array."""
        first, size = self._used, prod(shape)
        self._used += -(-size // _LINE) * _LINE
        return self._store[first : first + size].reshape(shape)

    def complex(self, *shape: int) -> ComplexArray:
        """Return an uninitialized complex array."""
        return self.real(*shape[:-1], 2 * shape[-1]).view(np.complex128)

    def vectors(self, rows: int, n: int) -> Vectors:
        """Return uninitialized vectors."""
        return Vectors(self.real(rows, n), self.complex(rows, n))

    @contextmanager
    def stage(self) -> Iterator[None]:
        """Release at the end the arrays that were taken inside the `with` block."""
        used = self._used
        try:
            yield
        finally:
            self._used = used


_LOCAL = threading.local()


def arena() -> Arena:
    """Return the arena of this thread."""
    if not hasattr(_LOCAL, "arena"):
        _LOCAL.arena = Arena()
    found: Arena = _LOCAL.arena
    return found
