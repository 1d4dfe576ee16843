"""Find leaps of a table angle: records that are wrong, an encoder that slips, angles that stop.

A table accelerates, but between two records it cannot leave the rate of the records around them by
more than its acceleration allows.
"""

from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.logs.record import TableLog
from rotcli.run.findings import Finding
from rotcli.run.motion import record_chunks
from rotcli.units import DEG, FloatArray, format_span, show_time

# rad: a leap of it over a minute at 30 deg/s is a scale factor error of 55 ppm, a third of the
# sigma of MEMS gyros
SMALL_LEAP = 0.1 * DEG
# rad: a leap of it rotates the horizontal error of a navigation by 0.5 %
LEAP = 0.3 * DEG
_LARGEST_ACCELERATION = 200.0 * DEG  # rad/s^2, of a rate table
_NEIGHBOURS = 10  # records to either side, whose median rate is the reference
_STEADY = 0.5  # of a leap: change of the angle per record from before to after
_SIGMAS = 8.0  # of the angle over an interval, from its own scatter
_RESOLUTIONS = 3.0  # times the encoder's: two neighbouring angles differ by two
_RETURN_SHARE = 0.1  # of a leap: records that come back to within it were wrong for a while
_MAX_WRONG_RECORDS = 100  # between a leap and its return
_MIN_EQUAL = 3  # records at one angle before a leap: an angle that stopped
_MAX_SHOWN = 4


@dataclass(frozen=True)
class Leap:
    """A leap of the angle: time (s) and size (rad); what happened.

    records: how many are wrong until the angle returns, 0 if it does not. since: s, from which on
    the angle was constant before it leaps, None if it was not.
    """

    time: float
    size: float
    records: int = 0
    since: float | None = None

    def in_words(self) -> str:
        """Return what happened, with time and size."""
        size = f"{abs(self.size) / DEG:.3g} deg"
        if self.since is not None:
            span = format_span(self.since, self.time)
            return f"the angle is constant from {span}, then leaps by {size}"
        if self.records:
            what = "record is" if self.records == 1 else "records are"
            return f"{self.records} {what} off by {size} at {show_time(self.time)} s"
        return f"the angle leaps by {size} at {show_time(self.time)} s"


def find_leaps(time: FloatArray, angle: FloatArray, resolution: float, least: float) -> list[Leap]:
    """Return the leaps of an angle (n,), rad, at times (n,), s, of at least `least` rad.

    resolution: rad, of the encoder.
    """
    if len(angle) < 4 * _NEIGHBOURS:
        return []
    interval = float(np.median(np.diff(time), overwrite_input=True))
    limit = max(least, _RESOLUTIONS * resolution, _LARGEST_ACCELERATION * interval**2)
    if not _is_suspicious(time, angle, interval, limit):
        return []
    dt, step = np.diff(time), np.diff(angle)
    padded = np.pad(step / dt, _NEIGHBOURS, mode="reflect")
    usual = np.median(sliding_window_view(padded, 2 * _NEIGHBOURS + 1), axis=-1) * dt
    deviation = step - usual
    typical = 1.4826 * float(np.median(np.abs(deviation)))
    limit = max(limit, _SIGMAS * typical)
    leaping = (np.abs(deviation) > limit) & (dt < 2.5 * interval)
    # A ramp within a few records looks like a leap, but the rate differs before and after it.
    medians = np.median(sliding_window_view(padded, _NEIGHBOURS), axis=-1)
    change = np.abs(medians[_NEIGHBOURS + 1 :][: len(step)] - medians[: len(step)]) * dt
    at = np.flatnonzero(leaping & (change < _STEADY * np.abs(deviation)))
    return _group(time, step, deviation, at)


def _is_suspicious(time: FloatArray, angle: FloatArray, interval: float, limit: float) -> bool:
    """Return whether a record deviates by half a limit (rad) from the line through two others.

    A few records at a time: of a log of days one difference takes as much memory as the log.
    """
    parts = [slice(p.start, p.stop + 2) for p in record_chunks(slice(0, len(angle) - 2))]
    steps = (np.diff(angle[part]) for part in parts)
    fastest = max(float(np.abs(step, out=step).max()) for step in steps) / interval
    for part in parts:
        # A wrong stamp is an angle at another time.
        deviation = np.abs(np.diff(angle[part], 2)) + fastest * np.abs(np.diff(time[part], 2))
        if (deviation > 0.5 * limit).any():
            return True
    return False


def _group(
    time: FloatArray, step: FloatArray, deviation: FloatArray, at: NDArray[np.intp]
) -> list[Leap]:
    """Return the leaps at the intervals `at`; one and its return are together."""
    leaps: list[Leap] = []
    k = 0
    while k < len(at):
        here = int(at[k])
        size = float(deviation[here])
        k += 1
        if step[here] == 0.0:
            continue  # the angle has stopped; the leap that ends it follows
        equal = 0
        while equal < here and step[here - 1 - equal] == 0.0:
            equal += 1
        if equal >= _MIN_EQUAL:
            leaps.append(Leap(float(time[here]), size, 0, float(time[here - equal])))
            continue
        records = 0
        if k < len(at) and at[k] - here <= _MAX_WRONG_RECORDS:
            back = float(deviation[at[k]])
            if abs(size + back) < _RETURN_SHARE * abs(size):
                records = int(at[k]) - here
                k += 1
        leaps.append(Leap(float(time[here + 1]), size, records))
    return leaps


def describe_leaps(leaps: Sequence[Leap]) -> str:
    """Return leaps in words: the first of them, and how many there are."""
    steps = [leap for leap in leaps if not leap.records and leap.since is None]
    if len(steps) > 1 and len(steps) == len(leaps):
        sizes = [abs(leap.size) / DEG for leap in leaps]
        times = ", ".join(show_time(leap.time) for leap in leaps[:_MAX_SHOWN])
        more = f" and {len(leaps) - _MAX_SHOWN} times more" if len(leaps) > _MAX_SHOWN else ""
        return f"the angle leaps by {max(sizes):.3g} deg at {times} s{more}"
    texts = [leap.in_words() for leap in leaps[:_MAX_SHOWN]]
    if len(leaps) > _MAX_SHOWN:
        texts.append(f"{len(leaps)} such places in all")
    return ", ".join(texts)


def check_leaps(
    table: TableLog, start: float, end: float, resolution: float, least: float
) -> tuple[Finding, ...]:
    """Return the finding of leaps of the table angle between start and end (s)."""
    first, last = (int(k) for k in np.searchsorted(table.time, [start, end]))
    leaps = find_leaps(table.time[first:last], table.angle[first:last], resolution, least)
    if not leaps:
        return ()
    largest = max(abs(leap.size) for leap in leaps)
    text = (
        f"{table.path}: {describe_leaps(leaps)}: no table moves like this. Check the encoder and "
        "its log, or exclude this part"
    )
    where = f"{show_time(leaps[0].time)} s"
    return (Finding("table-angle", text, "warning", where, largest / DEG, least / DEG, "deg"),)
