"""What the first records of a log show about units: sizes of readings, steps of time.

Only decisive cases count, those where one reading of the numbers is absurd and another is not.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import inf, log
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli.files.dialect import BLANK_CELLS
from rotcli.lazy import lazily
from rotcli.logs.container.columns import to_chunks
from rotcli.logs.container.header import Header
from rotcli.units import DEG_PER_ROOT_HOUR, STANDARD_GRAVITY, UNITS, FloatArray

with lazily():
    import statistics

    import pyarrow as pa

    from rotcli.logs.container import parquet_file


# Share by which the size of gravity may differ: biases, scale factors and tilt of a table at rest.
GRAVITY_TOLERANCE = 0.1
_INCREMENT_TOLERANCE = 0.05
_MIN_COUNTS = 100.0  # size of gravity in counts; a unit in which it is an integer is none
_MIN_RECORDS = 8  # that show a counter
_MIN_READINGS = 32  # that show a unit: a third of a second at 100 Hz
_SAMPLE_RECORDS = 400
_MAX_COUNTER_STEP = 8  # messages between two records of an IMU
_MIN_STILL = 100  # records that show whether an IMU is still
_MAX_MOTION = 0.02  # of gravity: scatter of accelerometers at rest
# rad/sqrt(s): 15 deg/sqrt(h), five times the coarser IMU of the papers; in deg/s it is 0.26.
_MAX_WALK = 15.0 * DEG_PER_ROOT_HOUR
# Sampling intervals of loggers, s: 5 kHz to 2 Hz. The unit of unnamed stamps is the one of these.
_SHORTEST, _LONGEST = 2e-4, 0.5
_SHORTEST_SECONDS = 1e-5  # s; no logger of turntables is faster than 100 kHz
_EPOCH = (9e8, 4e9)  # s of Unix time: the years 1998 to 2096
_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def numbers(header: Header, column: int) -> FloatArray:
    """Return the numbers of a column in the first records, without blanks; empty for text."""
    if header.arrays is not None:  # a bag
        return np.asarray(header.arrays[column][:_SAMPLE_RECORDS])
    if not header.is_text:
        return _parquet_numbers(header, column)
    found = []
    comma = header.plain.decimal == ","
    for cells in header.records:
        cell = cells[column] if column < len(cells) else ""
        if cell in BLANK_CELLS:
            continue
        try:
            found.append(float(cell.replace(",", ".") if comma else cell))
        except ValueError:
            return np.empty(0)
    return np.array(found)


def has_blank_records(header: Header, columns: Sequence[int]) -> bool:
    """Return whether some of the first records, not all, have blanks in all of the columns."""
    blank = blank_records(header, columns)
    return any(blank) and not all(blank)


def blank_records(header: Header, columns: Sequence[int]) -> list[bool]:
    """Return which of the first records have blanks in all of the columns; empty without any."""
    if not columns or header.kind == "bag":
        return []
    if header.is_text:
        return [all(k < len(c) and c[k] in BLANK_CELLS for k in columns) for c in header.records]
    first = _first_records(header.path, header.stamp)
    if not first or not len(first[0]):
        return []
    blank = [_blanks(first[k]) for k in columns]
    return [bool(all_blank) for all_blank in np.logical_and.reduce(blank)]


def _blanks(column: FloatArray | list[Any]) -> NDArray[np.bool_]:
    """Return which values of a column are null or NaN."""
    if isinstance(column, np.ndarray):
        return np.isnan(column)
    return np.array([value is None or value != value for value in column], dtype=bool)


@lru_cache(maxsize=4)
def _first_records(path: str, stamp: tuple[int, int] | None) -> list[FloatArray | list[Any]]:
    """Return the columns of the first records of a Parquet file, lists where some have no number.

    Not by Arrow's own tests for nulls, which import pyarrow.compute and pandas.
    """
    batch = parquet_file.first_records(path, stamp, _SAMPLE_RECORDS)
    if batch is None:
        return []
    return [
        to_chunks(pa.chunked_array([column]))[0].astype(float)
        if _is_number(column.type) and not column.null_count and len(column)
        else column.to_pylist()
        for column in batch.columns
    ]


def _is_number(kind: Any) -> bool:
    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))


def _parquet_numbers(header: Header, column: int) -> FloatArray:
    columns = _first_records(header.path, header.stamp)
    if column >= len(columns):
        return np.empty(0)
    values = columns[column]
    if isinstance(values, np.ndarray):
        return values
    known = [v for v in values if v is not None] if _is_number(header.types[column]) else []
    return np.array(known, dtype=float)


def are_integers(header: Header, columns: Sequence[int]) -> bool:
    """Return whether all numbers of columns are written as integers."""
    if not header.is_text:
        rows = [numbers(header, k) for k in columns]
        return all(len(r) >= _MIN_READINGS and bool(np.all(r == np.rint(r))) for r in rows)
    cells = [cells[k] for cells in header.records for k in columns if k < len(cells) and cells[k]]
    return len(cells) >= _MIN_READINGS and all(c.lstrip("+-").isdigit() for c in cells)


def gravity_size(header: Header, columns: Sequence[int]) -> float | None:
    """Return the median norm of the accelerometers in the first records, raw."""
    triad = [numbers(header, k) for k in columns]
    count = min(map(len, triad), default=0)
    if len(triad) < 3 or count < _MIN_READINGS:
        return None
    with np.errstate(over="ignore"):
        return float(np.median(np.sqrt(sum(row[:count] ** 2 for row in triad))))


def common_offset(header: Header, columns: Sequence[int]) -> float | None:
    """Return the middle of an unsigned 12- to 24-bit range that integers lie around, else None."""
    if not are_integers(header, columns):
        return None
    values = [float(np.median(numbers(header, k))) for k in columns]
    for bits in (24, 16, 14, 12, 10):
        middle = float(1 << (bits - 1))
        near = sum(abs(v - middle) < 0.25 * middle for v in values)
        if near >= 2 and all(0 <= v <= 2 * middle for v in values):
            return middle
    return None


def acceleration_unit(size: float | None) -> str | None:
    """Return the unit in which a norm of accelerometers is nearest to gravity, None far from all.

    >>> acceleration_unit(1.003), acceleration_unit(9.79), acceleration_unit(1001.0)
    ('g', 'm/s^2', 'mg')
    >>> acceleration_unit(979.9), acceleration_unit(32.17), acceleration_unit(5.0)
    ('cm/s^2', 'ft/s^2', None)
    """
    if size is None or not size > 0.0:
        return None
    distance = {
        unit: abs(log(size * factor / STANDARD_GRAVITY))
        for unit, factor in UNITS["acceleration"].items()
        if unit != "ug"  # as large as counts are
    }
    nearest = min(distance, key=lambda unit: distance[unit])
    return nearest if distance[nearest] < GRAVITY_TOLERANCE else None


def is_increment(size: float | None, interval: float | None, gravity: float | None = None) -> bool:
    """Return whether a norm of accelerometers is gravity times the sampling interval (s).

    gravity: in the unit of the norm (default: m/s^2).
    """
    return increment_error(size, interval, gravity) < _INCREMENT_TOLERANCE


def increment_error(
    size: float | None, interval: float | None, gravity: float | None = None
) -> float:
    """Return by which share a norm differs from gravity times the interval (s); else infinity."""
    if size is None or not interval or interval > _LONGEST:
        return inf
    return abs(size / ((gravity or STANDARD_GRAVITY) * interval) - 1.0)


def gravity_error(size: float, unit: str) -> float:
    """Return by which share a norm of accelerometers in a unit differs from gravity."""
    return abs(size * UNITS["acceleration"][unit] / STANDARD_GRAVITY - 1.0)


def looks_raw(header: Header, columns: Sequence[int]) -> bool:
    """Return whether accelerometers are raw counts: integers far above any acceleration."""
    size = gravity_size(header, columns)
    return are_integers(header, columns) and size is not None and size > _MIN_COUNTS


def is_still(header: Header, accel: Sequence[int]) -> bool:
    """Return whether the accelerometers scatter by little around a constant, as at rest."""
    size = gravity_size(header, accel)
    rows = [numbers(header, k) for k in accel]
    if size is None or min(map(len, rows)) < _MIN_STILL:
        return False
    with np.errstate(over="ignore", invalid="ignore"):
        motion = max(float(np.std(row)) for row in rows)
    return motion < _MAX_MOTION * size


def still_walk(
    header: Header, gyro: Sequence[int], accel: Sequence[int], interval: float | None
) -> float | None:
    """Return the angle random walk (rad/sqrt(s)) of still gyros if they are in rad/s, else None.

    The accelerometers show that the IMU is still. interval: s, of the samples.
    """
    rows = [numbers(header, k) for k in gyro]
    if not interval or min(map(len, rows)) < _MIN_STILL or not is_still(header, accel):
        return None
    scatter = [np.median(np.abs(np.diff(row))) for row in rows]
    return float(1.05 * np.median(scatter) * interval**0.5)  # median to sigma of white noise


def is_absurd_walk(walk: float, unit: str = "rad/s") -> bool:
    """Return whether gyros of this noise in rad/s are too noisy in a unit for any IMU."""
    return walk * UNITS["rate"][unit] > _MAX_WALK


def step(times: FloatArray) -> float:
    """Return the median step of times that follow one another, 0 where there is none."""
    steps = [b - a for a, b in zip(times.tolist(), times.tolist()[1:], strict=False) if b > a]
    return statistics.median(steps) if steps else 0.0


def mean_step(times: FloatArray) -> float:
    """Return the mean step of times, 0 for a single one."""
    return float(times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else 0.0


def is_counter(times: FloatArray) -> bool:
    """Return whether numbers count records: integers in steps of 1."""
    if len(times) < _MIN_RECORDS or not np.all(times == np.rint(times)):
        return False
    return float(np.mean(np.diff(times) == 1.0)) > 0.9


def counts_other_records(times: FloatArray) -> bool:
    """Return whether a counter counts the records of other messages as well as these.

    Its steps are small integers of which none is usual; lost records leave most steps at 1.
    """
    if len(times) < _MIN_RECORDS or not np.all(times == np.rint(times)):
        return False
    steps = np.diff(times)
    usual = max(float(np.mean(steps == k)) for k in range(1, _MAX_COUNTER_STEP))
    return bool(steps.min() >= 0.0 and float(np.median(steps)) < _MAX_COUNTER_STEP and usual < 0.7)


def time_unit(times: FloatArray, longest: float = 10.0) -> str | None:
    """Return the only unit in which stamps are those of a logger; None where s is, or several.

    longest: s, of steps that are plausible in s.

    The size of a Unix epoch decides first, then the step.

    >>> time_unit(np.arange(20) * 10000.0), time_unit(np.arange(20) * 0.01)
    ('us', None)
    """
    found = step(times)
    if not found or _SHORTEST_SECONDS <= found < longest * (1.0 - 1e-3):
        return None
    for unit, size in _UNITS.items():
        if _EPOCH[0] <= float(times[0]) * size <= _EPOCH[1] and size * found < _LONGEST:
            return unit if unit != "s" else None
    fitting = [unit for unit, size in _UNITS.items() if _SHORTEST <= found * size < _LONGEST]
    return fitting[0] if len(fitting) == 1 else None
