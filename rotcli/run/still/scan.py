"""Scan a log once: flags of missing and clipped samples, and statistics of blocks of a second."""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.files.channels import AXES
from rotcli.logs.record import ImuLog, ImuSource, align_chunks
from rotcli.units import FloatArray

Flags = NDArray[np.bool_]
Index = NDArray[np.int64]
Keys = NDArray[np.uint64]

_RANGE_TOLERANCE = 1.0 - 1e-7  # of the range: single precision stores seven digits
# Odd multipliers near 2^64 over the golden ratio (Knuth, The Art of Computer Programming, 6.4).
_MULTIPLIERS = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9)
KEY_BITS = 6  # one row in 64 is a mark, chosen by its readings: a copied row is chosen again


@dataclass(frozen=True, eq=False)
class BlockStatistics:
    """Flags (n,) of the samples of a span; of the axes (6), block by block.

    mean, square, low, high (6, blocks): mean, mean square about it, smallest and largest reading;
    digit (6,): smallest step between readings. marks, keys (k,): rows chosen by their readings,
    and a number made of these.
    """

    missing: Flags
    clipped: Flags
    size: int
    mean: FloatArray
    square: FloatArray
    low: FloatArray
    high: FloatArray
    digit: FloatArray
    marks: Index
    keys: Keys

    @property
    def blocks(self) -> int:
        """How many blocks."""
        return int(self.mean.shape[1])


def scan(
    log: ImuSource, span: slice, gyro_range: float | None, accel_range: float | None
) -> BlockStatistics:
    """Scan a span chunk by chunk; gyro_range rad/s, accel_range m/s^2: clipped samples."""
    n = span.stop - span.start
    size = min(max(10, round(1.0 / log.interval)), n // 10)
    blocks = n // size
    missing, clipped = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    figures = np.empty((4, 6, blocks))
    digit: FloatArray | None = None
    marks: list[Index] = []
    keys: list[Keys] = []
    at = 0
    for chunk in align_chunks(log.chunks(span), size):
        part = slice(at, at + chunk.samples)
        full = chunk.samples // size * size
        block = slice(at // size, at // size + full // size)
        if chunk.missing is not None:
            missing[part] = chunk.missing
        for k, name in enumerate(AXES):
            column = np.ascontiguousarray(chunk.column(name))
            limit = gyro_range if k < 3 else accel_range
            if limit is not None and max(column.max(), -column.min()) >= limit * _RANGE_TOLERANCE:
                clipped[part] |= np.abs(column) >= limit * _RANGE_TOLERANCE
            figures[:, k, block] = _block_figures(column[:full].reshape(-1, size))
        key = _row_keys(chunk)
        chosen = np.flatnonzero(key >> np.uint64(64 - KEY_BITS) == 0)
        marks.append(chosen + at)
        keys.append(key[chosen])
        if digit is None:
            digit = np.array([_last_digit(chunk.column(name)[:100]) for name in AXES])
        at = part.stop
    mean, square, low, high = figures
    found = np.zeros(6) if digit is None else digit
    return BlockStatistics(
        missing, clipped, size, mean, square, low, high, found,
        np.concatenate(marks), np.concatenate(keys),
    )  # fmt: skip


def _block_figures(values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return mean, mean square about it, smallest and largest of the blocks (blocks, size)."""
    mean = values.mean(axis=1)
    square = np.einsum("ij,ij->i", values, values) / values.shape[1] - mean**2
    # Seven digits are all that a log in single precision has.
    return mean, np.maximum(square, 1e-15 * mean**2), values.min(axis=1), values.max(axis=1)


def _row_keys(log: ImuLog) -> Keys:
    """Return a number (n,) of the bits of the gyro readings; equal rows have equal numbers."""
    total = np.zeros(log.samples, dtype=np.uint64)
    for axis, multiplier in zip("xyz", _MULTIPLIERS, strict=True):
        bits = np.ascontiguousarray(log.column(f"gyro_{axis}")).view(np.uint64)
        total += bits * np.uint64(multiplier)
    total ^= total >> np.uint64(29)
    return total * np.uint64(_MULTIPLIERS[0])


def _last_digit(values: FloatArray) -> float:
    """Return the smallest step between neighbouring values, 0 without any."""
    steps = np.abs(np.diff(values.ravel()))
    return float(steps[steps > 0.0].min()) if np.any(steps > 0.0) else 0.0


def runs(flags: Flags) -> Index:
    """Return the runs of set flags (n,) as rows (k, 2): first, and one after the last."""
    padded = np.zeros(len(flags) + 2, dtype=bool)
    padded[1:-1] = flags
    return np.flatnonzero(padded[1:] != padded[:-1]).reshape(-1, 2)
