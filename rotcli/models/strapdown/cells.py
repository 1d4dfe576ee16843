"""Layout of a block of samples in cells, and the memory that all blocks share.

A block has n cells of ROWS samples, sample = ROWS * cell + row. The last axes of every array are
(row, cell): the next sample is the next row, a recursion over time runs over ROWS rows of n
numbers, and a constant of a cell applies to all its rows.

A vector in space is one real polar component (along the Earth's axis) and one complex equatorial
component, so that a rotation about the Earth's axis is a complex factor. An array (..., 3n) has
the n polar components first, then the n equatorial ones; `polar` and `plane` return views.
"""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from math import prod

import numpy as np
from numpy.typing import NDArray

from rotcli.units import FloatArray

ComplexArray = NDArray[np.complex128]

ROWS = 32  # samples of a cell
CELLS = 512  # cells of a full block; more leave the cache, fewer are slow because of the calls
# Samples that the stencils need before and after the block's cells: means need the most.
BEFORE, AFTER = 3, 5
_ARENA_SIZE = 64 * ROWS * (CELLS + 4)  # doubles; the stages of a block need less than 50 arrays


def polar(x: FloatArray) -> FloatArray:
    """Return the polar components (..., n) of vectors (..., 3n), a view."""
    return x[..., : x.shape[-1] // 3]


def plane(x: FloatArray) -> ComplexArray:
    """Return the equatorial components (..., n), complex, of vectors (..., 3n), a view."""
    return x[..., x.shape[-1] // 3 :].view(np.complex128)


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


def entries(samples: NDArray[np.intp], n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the indices, rows (k, 1) and columns (k, 3) of x, y, z, of samples (k,)."""
    cell = samples // ROWS
    columns = np.stack([n + 2 * cell, n + 2 * cell + 1, cell], axis=-1)
    return (samples % ROWS)[:, None], columns


class Arena:
    """Memory for the intermediate arrays of one block, used again by the next block.

    New pages cost more than the arithmetic on them, so the arrays are not allocated per block.
    """

    def __init__(self) -> None:
        self._store = np.empty(_ARENA_SIZE)
        self._used = 0

    def real(self, *shape: int) -> FloatArray:
        """Return an uninitialized real array."""
        size = prod(shape)
        first, self._used = self._used, self._used + size
        return self._store[first : self._used].reshape(shape)

    def complex(self, *shape: int) -> ComplexArray:
        """Return an uninitialized complex array."""
        return self.real(*shape[:-1], 2 * shape[-1]).view(np.complex128)

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
