"""VectorNav: lines of the ASCII protocol."""

import re
from typing import Any, ClassVar

from rotcli.files.formats.base import Head, LogFormat

# Place of the first gyro and accelerometer value after the name of the message (VN-100 User
# Manual UM001, chapter on asynchronous ASCII messages).
_MESSAGES = {
    "VNYMR": {"accel": 7, "gyro": 10},
    "VNQMR": {"accel": 8, "gyro": 11},
    "VNIMU": {"accel": 4, "gyro": 7},
    "VNMAR": {"accel": 4, "gyro": 7},
}
_OTHER_MESSAGES = re.compile(rb"(?m)^[^$\n]*\$VN(?!YMR|QMR|IMU|MAR)[A-Z0-9]{3},[^\n]*(?:\n|$)")
_CHECKSUM = re.compile(rb"\*[0-9A-Fa-fX]{2,4}[ \t]*(?=\n|$)")


class VectorNav(LogFormat):
    """$VNYMR, $VNQMR, $VNIMU or $VNMAR lines; a time stamp of the computer may come first."""

    name = "vectornav"
    title = "VectorNav ASCII messages"
    source = "VectorNav VN-100 User Manual UM001"
    rig: ClassVar[dict[str, Any]] = {
        "units": {"gyro": "rad/s", "accel": "m/s^2"},
        "delimiter": ",",
    }
    pattern = r"(?m)^[^$\n]{0,40}\$VN(?:YMR|QMR|IMU|MAR),"

    def rig_defaults(self, head: Head) -> dict[str, Any]:
        """Return the keys for one file: the columns that follow the name of its message."""
        found = dict(self.rig)
        cells = head.records[0] if head.records else ()
        place = next((k for k, cell in enumerate(cells) if cell.lstrip("$") in _MESSAGES), None)
        if place is None:
            return found
        message = _MESSAGES[cells[place].lstrip("$")]
        found["columns"] = {
            f"{sensor}_{axis}": place + 1 + first + k
            for sensor, first in message.items()
            for k, axis in enumerate("xyz")
        }
        if place > 0:
            found["columns"]["time"] = 1
        else:
            found["needs_rate"] = True
        if cells[place].endswith("VNIMU"):
            found["columns"]["temperature"] = place + 11
        return found

    def clean(self, block: bytes) -> bytes:
        """Return the lines without checksums, and without other messages."""
        return _CHECKSUM.sub(b"", _OTHER_MESSAGES.sub(b"", block))
