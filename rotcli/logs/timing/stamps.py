"""Time stamps of a log as increasing seconds: numbers, dates, counters; wraps and repeats.

Counters that start again are unrolled and reported, identical repeated records dropped. A clock
that restarts cannot be repaired: the message says where to split the log. It is never advised to
sort records: sorted, two recordings would be mixed.
"""

from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.logs.container.columns import Loaded
from rotcli.logs.describe.layout import Layout, Problem, TimeSource, raise_all
from rotcli.rig.rig import LogSettings
from rotcli.units import FloatArray, show_time

_COUNTER_BITS = (16, 24, 31, 32)
_WEEK, _DAY = 604800.0, 86400.0  # s
_MAX_LOST = 10.0  # samples that may be missing where a counter starts again
# Share of records with the stamp of the one before, above which the stamps have too few digits.
_MAX_REPEATED = 0.5
# Samples that share a stamp, above which counting is not assumed: the rate would be uncertain.
_MAX_COARSE = 32.0
_MIN_STEPS = 100  # steps of coarse stamps: the rate of the line through them is known to 1 %
_MIN_ISOLATED = 10  # records that show the usual step
_MAX_ISOLATED_SPAN = 4.0  # samples between the records on both sides of a wrong stamp
_MAX_COUNT = 2.0**63  # of a counter of ns, us, ticks ...
_LATEST = 1e11  # s; no clock shows more: an error of another kind
_LOST_START = 86400.0  # s; a first stamp a day away from all others is wrong
# Share of records out of order that is a delay of transport, not a restart.
_MIN_DISORDER = 3


@dataclass(frozen=True)
class Stamps:
    """Times (n,), s, that do not go back, the records that belong to them, and warnings.

    repeated: some times are those of the record before.
    """

    time: FloatArray
    loaded: Loaded
    notes: tuple[str, ...] = ()
    repeated: bool = False


def read_stamps(loaded: Loaded, layout: Layout, settings: LogSettings, section: str) -> Stamps:
    """Return the times of the records of a log; raises LogError where they make no clock."""
    time = seconds(loaded, layout.time)
    counted = settings.clock == "count"
    steps = np.diff(time)
    notes: list[str] = []
    if len(steps) and not counted and (steps.min() < 0.0 or abs(steps[0]) > _LOST_START):
        _check_isolated(loaded, time, steps, section)
    if len(steps) and steps.min() < 0.0:
        time, unrolled = _unroll(loaded, layout.time, time)
        notes += unrolled
        steps = np.diff(time)
        if steps.min() < 0.0 and not counted:
            _raise_back(loaded, time, steps, section)
    repeats = np.flatnonzero(steps == 0.0)
    if not repeats.size or counted:
        return Stamps(time, loaded, tuple(notes), repeated=bool(repeats.size))
    identical = _identical(loaded, repeats, layout)
    share = len(repeats) / len(time)
    dropped = 0
    if identical.any() and share <= _MAX_REPEATED:
        keep = np.ones(len(time), dtype=bool)
        keep[repeats[identical] + 1] = False
        dropped = int(np.count_nonzero(identical))
        loaded, time = loaded.select(keep), time[keep]
        repeats = np.flatnonzero(np.diff(time) == 0.0)
    left = len(repeats)
    first = loaded.row(int(repeats[0]) + 1) if left else 0
    if left and (share > _MAX_REPEATED or settings.clock == "stamps" or section != "imu"):
        _check_coarse(loaded, time, settings, section, first)
    if dropped:
        word = "record repeats" if dropped == 1 else "records repeat"
        notes.append(
            f"{loaded.header.path}: {dropped} identical {word} the one before. They are dropped"
        )
    return Stamps(time, loaded, tuple(notes), repeated=bool(left))


def _check_isolated(loaded: Loaded, time: FloatArray, steps: FloatArray, section: str) -> None:
    """Raise LogError for single wrong stamps between correct ones, which are no restart.

    A stamp is wrong where the records on both sides follow one another as usual without it.
    """
    n = len(time)
    if n < _MIN_ISOLATED or max(float(time.max()), -float(time.min())) >= _LATEST:
        return
    usual = float(np.median(steps[: 4 * _MIN_STEPS]))
    far = np.abs(steps) > _MAX_LOST * usual
    if usual <= 0.0 or not far.any():
        return
    across = time[2:] - time[:-2]
    near = (across > 0.5 * usual) & (across < _MAX_ISOLATED_SPAN * usual)
    wrong = np.flatnonzero(far[:-1] & far[1:] & near & (steps[:-1] * steps[1:] < 0.0)) + 1
    if abs(steps[0]) > _LOST_START and not far[1:].any():  # written before the clock was set
        wrong = np.union1d(wrong, [0])
    if not len(wrong) or len(wrong) > max(3, n // 1000):
        return
    i = int(wrong[0])
    row, shown = loaded.row(i), show_time(float(time[i]))
    back = steps[i - 1] if i and steps[i - 1] < 0.0 else steps[i]
    step = f"time goes back by {-back:.6g} s" if back < 0.0 else f"time jumps by {back:.6g} s"
    others = f", and {len(wrong) - 1} more" if len(wrong) > 1 else ""
    finding = f"{step}: the stamp {shown} s does not fit the rows around it{others}"
    error = LogError(
        loaded.header.path,
        f'{finding}; remove this row, or set [{section}] clock = "count" if no sample was lost',
        row=row,
        column="time",
    )
    error.problems = (
        Problem(f"row {row}: {finding}", {section: {"clock": "count"}}, "or remove this row"),
    )
    raise error


def seconds(loaded: Loaded, source: TimeSource) -> FloatArray:
    """Return the times (n,), s, as the columns contain them."""
    n = loaded.rows
    time = np.empty(n)
    if source.kind == "none":
        time = source.start + source.interval * np.arange(n, dtype=float)
        if source.correction is not None:
            shift = np.empty(n)
            place = len(loaded.columns) - 1
            loaded.fill(shift, place, 1e-6)
            time += np.cumsum(shift)
        return time
    if source.kind == "counter":
        loaded.fill(time, 0, 1.0)
        return time / source.scale[0]
    _check_64_bits(loaded)
    loaded.fill(time, 0, source.scale[0])
    if len(source.columns) > 1:
        more = np.empty(n)
        loaded.fill(more, 1, source.scale[1])
        time += more
    return time


def _check_64_bits(loaded: Loaded) -> None:
    """Raise LogError for time stamps beyond the 63 bits of a counter, which no logger has."""
    start = 0
    for chunk in loaded.columns[0]:
        large = np.abs(chunk[[0, -1]]).max() >= _MAX_COUNT if len(chunk) else False
        if large and chunk.dtype.kind == "f":
            i = start + int(np.argmax(np.abs(chunk) >= _MAX_COUNT))
            what = f"{chunk[i - start]:.6g} is beyond 63 bits, so it is not a time of a clock"
            finding = f"{what}; correct the row or set the unit of time"
            raise LogError(loaded.header.path, finding, row=loaded.row(i), column="time")
        start += len(chunk)


def _periods(source: TimeSource) -> list[float]:
    """Return the times, s, after which a counter of this source may start again."""
    if source.kind == "counter":
        own = [p / source.scale[0] for p in source.periods]
        ticks = [float(1 << bits) / source.scale[0] for bits in (8, *_COUNTER_BITS)]
        return [*own, *ticks]
    own = [float(1 << bits) * source.scale[0] for bits in _COUNTER_BITS if source.scale[0] < 1.0]
    # Seconds that a program made of a counter of 32 bits in ms or us.
    return [*source.periods, *own, 2.0**32 * 1e-3, 2.0**32 * 1e-6, _WEEK, _DAY]


def _unroll(loaded: Loaded, source: TimeSource, time: FloatArray) -> tuple[FloatArray, list[str]]:
    """Return the times with the starts of a counter undone, and the warning about them."""
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    added = np.zeros(len(steps))
    found: dict[float, int] = {}
    for i in np.flatnonzero(steps < 0.0):
        for period in _periods(source):
            after = period + steps[i]
            if -1e-9 * period < after <= _MAX_LOST * usual and after > 0.0:
                added[i] = period
                found.setdefault(period, int(i))
                break
    if not found:
        return time, []
    time = time.copy()
    time[1:] += np.cumsum(added)
    notes = [
        f"{loaded.header.path}: the time starts again after {_show_period(period, source)} in row "
        f"{loaded.row(i + 1)}. It is unrolled"
        for period, i in found.items()
    ]
    return time, notes


def _show_period(period: float, source: TimeSource) -> str:
    """Return a period in the units of the counter."""
    if period == _WEEK:
        return "a GPS week (604800 s)"
    if period == _DAY:
        return "a day (86400 s)"
    scale = 1.0 / source.scale[0] if source.kind == "counter" else source.scale[0]
    ticks = period / scale
    for bits in (8, *_COUNTER_BITS):
        if abs(ticks / (1 << bits) - 1.0) < 1e-9:
            return f"2^{bits} {source.unit or 'ticks'}"
    return f"{period:.9g} s"


def _raise_back(loaded: Loaded, time: FloatArray, steps: FloatArray, section: str) -> None:
    """Raise LogError for times that go back: a restart, or records out of order."""
    back = np.flatnonzero(steps < 0.0)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    i = int(back[0])
    row = loaded.row(i + 1)
    small = usual > 0.0 and float(-steps[back].min()) < 10.0 * usual
    count = {section: {"clock": "count"}}
    if small and len(back) >= _MIN_DISORDER:
        finding = (
            f"time goes back in {len(back)} rows, first by {-steps[i]:.6g} s in row {row}: records "
            "out of order"
        )
        raise_all(
            loaded.header.path,
            [Problem(finding, count, "if they are in the order of measurement")],
        )
    finding = f"time goes back by {-steps[i]:.6g} s, probably a restart of the logger"
    if len(back) > 1:
        finding += f" ({len(back)} times)"
    error = LogError(
        loaded.header.path,
        f'{finding}; split the log at this row, or set [{section}] clock = "count" if no sample '
        "was lost",
        row=row,
        column="time",
    )
    error.problems = (Problem(finding, count, f"or split the log at row {row}"),)
    raise error


def _identical(loaded: Loaded, repeats: NDArray[np.int64], layout: Layout) -> NDArray[np.bool_]:
    """Return which of the records after `repeats` are equal to the record before."""
    same = np.ones(len(repeats), dtype=bool)
    for k in range(len(layout.time.columns), len(loaded.columns)):
        column = loaded.column(k)
        same &= column[repeats] == column[repeats + 1]
    return same


def raise_constant_stamps(path: str, rows: int, stamp: float, section: str) -> NoReturn:
    """Raise LogError for a log all of whose stamps are one time (s)."""
    finding = f"all {rows} time stamps are {show_time(stamp)}"
    line = {section: {"clock": "count", "rate": 100.0}}
    raise_all(path, [Problem(finding, line, "with the sampling rate, Hz, or write more digits")])


def _check_coarse(
    loaded: Loaded, time: FloatArray, settings: LogSettings, section: str, first: int
) -> None:
    """Raise LogError for stamps so coarse that the records between them cannot be placed."""
    steps = np.diff(time)
    moving = steps[steps > 0.0]
    repeated = len(steps) - len(moving)
    tick = float(np.median(moving)) if moving.size else 0.0
    per_stamp = len(time) / (len(moving) + 1)
    runs = np.diff(np.flatnonzero(np.concatenate([[True], steps > 0.0, [True]])))
    usual = float(np.median(runs)) if len(runs) else per_stamp
    if (
        settings.clock == "regular"
        and section == "imu"
        and usual <= _MAX_COARSE
        and len(moving) >= _MIN_STEPS
    ):
        return
    count = {section: {"clock": "count"}}
    if repeated > _MAX_REPEATED * len(time):
        if not moving.size:
            raise_constant_stamps(loaded.header.path, len(time), float(time[0]), section)
        finding = f"time stamps have steps of {tick:.6g} s for {usual:.3g} rows each"
        raise_all(loaded.header.path, [Problem(finding, count, "or write more digits")])
    rows = "row" if repeated == 1 else "rows"
    finding = (
        f"time repeats the previous stamp in {repeated} {rows}, first in row {first}, with other "
        "readings"
    )
    raise_all(loaded.header.path, [Problem(finding, count, "if no sample was lost")])
