"""The interface of a log format: how to recognise a file and what a rig would say of it."""

import re
from collections.abc import Mapping
from typing import Any, ClassVar

from rotcli.files.channels import AXES

Column = str | int  # name of a column, or its number counted from 1

# Sensor axes of IMUs whose axes point forward, right, down, as rows in the frame right, forward,
# up.
FORWARD_RIGHT_DOWN = ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0))
FORWARD_LEFT_UP = ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
RIGHT_FORWARD_UP = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
FRAMES = {
    "rfu": RIGHT_FORWARD_UP,
    "enu": RIGHT_FORWARD_UP,
    "frd": FORWARD_RIGHT_DOWN,
    "ned": FORWARD_RIGHT_DOWN,
    "flu": FORWARD_LEFT_UP,
}


class LogFormat:
    """A format of IMU logs; a subclass describes one, an entry in `FORMATS` installs it.

    rig: keys of [imu] that the format determines. A rig's own keys override them. pattern: what
    the first lines of such a file match, for recognition without `format`. wraps: counts at which
    the counter of the time column starts again.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    source: ClassVar[str]  # where the layout is documented
    rig: ClassVar[Mapping[str, Any]] = {}
    pattern: ClassVar[str | None] = None
    head_lines: ClassVar[int] = 0  # lines of numbers between header and records
    wraps: ClassVar[tuple[int, ...]] = ()

    def is_format(self, head: str) -> bool:
        """Return whether the first lines of a file are written in this format."""
        return self.pattern is not None and re.search(self.pattern, head) is not None

    def rig_defaults(self, head: "Head") -> dict[str, Any]:
        """Return the [imu] keys for one file: `rig`, and what its head adds."""
        return dict(self.rig)

    def clean(self, block: bytes) -> bytes:
        """Return lines of text with separators that a CSV reader understands."""
        return block


class Head:
    """The head of a text log: column names, comments, lines of numbers, first records.

    values: (line number, numbers) of the lines of numbers. records: cells of the first records.
    """

    def __init__(
        self,
        path: str,
        names: tuple[str, ...],
        comments: tuple[str, ...],
        values: tuple[tuple[int, list[float]], ...],
        records: tuple[tuple[str, ...], ...],
    ) -> None:
        self.path = path
        self.names = names
        self.comments = comments
        self.values = values
        self.records = records

    def numbers(self, name: str) -> list[float]:
        """Return the numbers of a column in the first records; empty where it has none."""
        if name not in self.names:
            return []
        k = self.names.index(name)
        found = []
        for cells in self.records:
            try:
                found.append(float(cells[k]))
            except (ValueError, IndexError):
                return []
        return found

    def comment_value(self, pattern: str) -> str | None:
        """Return the first group of a pattern in the comments, None where no line matches."""
        for line in self.comments:
            found = re.search(pattern, line)
            if found:
                return found[1]
        return None


def columns(*names: Column) -> dict[str, Column]:
    """Return the columns of time and the six axes, in this order."""
    return dict(zip(("time", *AXES), names, strict=True))


def triads(gyro: str, accel: str, axes: str = "xyz") -> dict[str, Column]:
    """Return the columns of both triads from patterns with `{}` for the axis."""
    return {
        f"{sensor}_{axis}": pattern.format(letter)
        for sensor, pattern in (("gyro", gyro), ("accel", accel))
        for axis, letter in zip("xyz", axes, strict=True)
    }
