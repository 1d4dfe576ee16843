"""Check that a calibration does not use segments of the warm-up.

A warm-up result gives the time after power-on; a temperature column shows a change itself.
"""

from collections.abc import Sequence

import numpy as np

from rotcli.files.results.documents import number, read_result
from rotcli.lazy import lazily
from rotcli.logs.record import ImuSource, Segment
from rotcli.rig.rig import Rig
from rotcli.run.findings import Finding
from rotcli.units import format_span

with lazily():
    from rotcli.logs import temperature as thermometers

WARM_UP_KIND = "warm-up"
# 1 degC changes the bias of a MEMS gyro by some 10 deg/h, its in-run bias instability.
MAX_TEMPERATURE_CHANGE = 1.0  # degC


def warm_up_findings(
    imu: ImuSource, rig: Rig, segments: Sequence[Segment], warm_up: str | None
) -> list[Finding]:
    """Return findings for segments inside the warm-up time and for a changing temperature.

    warm_up: result of a warm-up test, or None; power-on is the first sample. Raises ResultError
    for a file that is none.
    """
    found = []
    first = float(imu.time[0])
    if warm_up is not None:
        doc = read_result(warm_up, WARM_UP_KIND)
        time = number(doc, warm_up, "warm_up_time_s")
        early = [s for s in segments if s.start - first < time]
        if early:
            text = (
                f"{imu.path}: the segment {format_span(early[0].start, early[0].end)} begins "
                f"before the warm-up of {time:.0f} s is over ({warm_up}). Its bias is not that of "
                "the warm sensor; use later segments"
            )
            start = early[0].start - first
            where = "segment"
            found.append(
                Finding("warm-up-not-over", text, where=where, value=start, limit=time, unit="s")
            )
    if not segments or next(imu.chunks(slice(0, 1))).temperature is None:
        return found
    temperature = thermometers.read_temperature(imu, rig)
    if temperature is not None:
        times = np.concatenate([np.linspace(s.start, s.end, 11) for s in segments])
        T = temperature.at(times)
        change = float(np.ptp(T))
        if change > MAX_TEMPERATURE_CHANGE:
            text = (
                f"{imu.path}: the temperature changes from {np.min(T):.1f} to {np.max(T):.1f} degC "
                "in the segments. The bias is a mean over it; wait for the warm-up to end, or "
                "estimate the bias over temperature"
            )
            found.append(
                Finding(
                    "temperature-changes",
                    text,
                    where="temperature",
                    value=change,
                    limit=MAX_TEMPERATURE_CHANGE,
                    unit="degC",
                )
            )
    return found
