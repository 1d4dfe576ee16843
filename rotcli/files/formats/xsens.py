"""Xsens exports: MT Manager (MTi, MTw) and the DOT app."""

import itertools
from typing import Any

from rotcli.files.formats.base import Head, LogFormat, triads
from rotcli.lazy import lazily

with lazily():
    import statistics

# Counts per second of SampleTimeFine (MT Low Level Communication Protocol, MT0101P).
_FINE_TICK = 1e4
# Counts between two records above which SampleTimeFine counts microseconds: 5000 ticks of 100 us
# are 0.5 s, 5000 us are 200 Hz, and a DOT measures at 1 to 120 Hz.
_MICROSECONDS = 5000.0


class Xsens(LogFormat):
    """Text export of MT Manager; also read where an export of the DOT app is named so.

    Time is SampleTimeFine where it is filled, else PacketCounter at the rate of the comments.
    """

    name = "xsens"
    title = "Xsens MT Manager ASCII export"
    source = "Xsens MT0101P (SampleTimeFine, PacketCounter), MT0605P (units)"
    rig = {
        "columns": triads("Gyr_{}", "Acc_{}", "XYZ"),
        "units": {"gyro": "rad/s", "accel": "m/s^2"},
        "comment": "//",
    }
    pattern = r"(?m)\A//|^PacketCounter\b"
    wraps = (1 << 32, 1 << 16)
    counters = ("PacketCounter", "Counter")  # the second in older exports

    def rig_defaults(self, head: Head) -> dict[str, Any]:
        """Return the keys for one file: which counter is filled, and its rate."""
        found = {**self.rig, "columns": dict(self.rig["columns"])}
        fine = head.numbers("SampleTimeFine")
        if fine:
            steps = [b - a for a, b in itertools.pairwise(fine) if b > a]
            micro = bool(steps) and statistics.median(steps) >= _MICROSECONDS
            found["columns"]["time"] = "SampleTimeFine"
            found["counter_rate"] = 1e6 if micro else _FINE_TICK
            if micro:
                found["units"] = {"gyro": "deg/s", "accel": "m/s^2"}
        elif counter := next((name for name in self.counters if name in head.names), None):
            pattern = r"(?i)(?:update|sampl\w*|output|data) ?rate\s*:\s*([0-9.]+)\s*Hz"
            rate = head.comment_value(pattern)
            found["columns"]["time"] = counter
            if rate and float(rate) > 0.0:
                found["counter_rate"] = float(rate)
            else:
                found["needs_rate"] = True
        return found


class XsensDot(LogFormat):
    """CSV export of the Xsens (Movella) DOT app: SampleTimeFine in us, gyros in deg/s."""

    name = "xsens-dot"
    title = "Xsens DOT CSV export"
    source = "Xsens DOT User Manual, XD0502P (data export)"
    rig = {
        "columns": {"time": "SampleTimeFine", **triads("Gyr_{}", "Acc_{}", "XYZ")},
        "units": {"time": "us", "gyro": "deg/s", "accel": "m/s^2"},
    }
    pattern = (
        r"(?m)^(?:sep=,\s*)?(?:DeviceTag|Device Tag|FirmwareVersion)\b"
        r"|^PacketCounter,SampleTimeFine,(?!.*\t)"
    )
    wraps = (1 << 32,)
