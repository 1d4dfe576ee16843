"""NovAtel SPAN: raw increments of RAWIMU, RAWIMUS, RAWIMUX and RAWIMUSX."""

import math
import re
from typing import Any, ClassVar

from rotcli.files.formats.base import Head, LogFormat

_DEG, _FOOT = math.pi / 180.0, 0.3048
_HONEYWELL = 2.0**-33
# IMU type: name, radians and m/s of one count (OEM7 Commands and Logs Reference Manual, RAWIMUSX,
# table of raw IMU scale factors). Types whose factor depends on the rate are missing.
IMU_SCALES: dict[int, tuple[str, float, float]] = {
    1: ("HG1700-AG11", _HONEYWELL, _FOOT * 2.0**-27),
    4: ("HG1700-AG17", _HONEYWELL, _FOOT * 2.0**-26),
    5: ("HG1900-CA29", _HONEYWELL, _FOOT * 2.0**-27),
    8: ("LN200", 2.0**-19, 2.0**-14),
    11: ("HG1700-AG58", _HONEYWELL, _FOOT * 2.0**-27),
    12: ("HG1700-AG62", _HONEYWELL, _FOOT * 2.0**-26),
    13: ("IMU-FSAS", 0.1 * 2.0**-8 * _DEG / 3600.0, 0.05 * 2.0**-15),
    16: ("IMU-CPT", 0.1 / (3600.0 * 256.0), 0.05 * 2.0**-15),
    20: ("HG1930-AA99", _HONEYWELL, _FOOT * 2.0**-27),
    26: ("ISA-100C", 1e-9, 2e-8),
    27: ("HG1900-CA50", _HONEYWELL, _FOOT * 2.0**-27),
    28: ("HG1930-CA50", _HONEYWELL, _FOOT * 2.0**-27),
    31: ("ADIS-16488", 720.0 * 2.0**-31 * _DEG, 200.0 * 2.0**-31),
    32: ("STIM300", 2.0**-21 * _DEG, 2.0**-22),
    33: ("KVH1750", 0.1 / (3600.0 * 256.0), 0.05 * 2.0**-15),
    52: ("uIMU-IC", 1e-9, 2e-8),
    56: ("STIM300D", 2.0**-21 * _DEG, 2.0**-22),
    58: ("HG4930-AN01", _HONEYWELL, 2.0**-29),
    68: ("HG4930-AN04", _HONEYWELL, 2.0**-29),
    69: ("HG4930-AN04 400 Hz", _HONEYWELL, 2.0**-29),
}
_CHECKSUM = re.compile(rb"\*[0-9a-fA-F]{8}[ \t]*(?=\n|$)")
_OTHER_MESSAGES = re.compile(rb"(?m)^[#%](?!RAWIMU)[A-Z0-9]+A,[^\n]*(?:\n|$)")
_GRAVITY = 9.8  # m/s^2, to a few percent
_MATCH = 0.05  # share by which a table of gravity may be off: tilt, bias


class NovAtel(LogFormat):
    """ASCII lines; week and seconds are the time, the y axes are logged with the other sign.

    RAWIMUX and RAWIMUSX name the type of the IMU and with it the size of a count; for the others
    the rig has to set `scale`.
    """

    name = "novatel"
    title = "NovAtel RAWIMU ASCII logs"
    source = "NovAtel OEM7 Commands and Logs Reference Manual, RAWIMUS and RAWIMUSX"
    rig: ClassVar[dict[str, Any]] = {
        "units": {"gyro": "rad", "accel": "m/s"},
        "delimiter": ",",
        "sampling": "increment",
    }
    pattern = r"(?m)^[#%]RAWIMUS?X?A,"

    def is_format(self, head: str) -> bool:
        """Return whether a line starts with the name of a raw IMU message."""
        return re.search(self.pattern, head) is not None

    def rig_defaults(self, head: Head) -> dict[str, Any]:
        """Return the keys for one file: columns by the kind of its message, and its scale."""
        found = dict(self.rig)
        cells = head.records[0] if head.records else ()
        if not cells:
            return found
        extended = cells[0].endswith("XA")
        # The last six values: z, -y, x of the accelerometers, then of the gyros.
        last = len(cells)
        if last < 10:
            return found
        names = ("accel_z", "accel_y", "accel_x", "gyro_z", "gyro_y", "gyro_x")
        found["columns"] = {name: last - 5 + k for k, name in enumerate(names)}
        found["columns"]["time"] = (last - 8, last - 7)
        found["week_and_seconds"] = True
        imu_type = cells[last - 10] if extended else ""
        if imu_type.isdigit() and int(imu_type) in IMU_SCALES:
            _, gyro, accel = IMU_SCALES[int(imu_type)]
            found["scale"] = _signed(gyro, accel)
        else:
            found["signs"] = {"gyro_y": -1.0, "accel_y": -1.0}
            found["needs_scale"] = self._candidates(head, last)
        return found

    def _candidates(self, head: Head, last: int) -> list[tuple[str, float, float]]:
        """Return the IMUs for which the accelerometers of the first records measure gravity."""
        complete = [cells for cells in head.records if len(cells) == last]
        try:
            rows = [[float(c[last - 8]), *map(float, c[last - 6 : last - 3])] for c in complete]
        except ValueError:
            return []
        if len(rows) < 2 or rows[-1][0] <= rows[0][0]:
            return []
        interval = (rows[-1][0] - rows[0][0]) / (len(rows) - 1)
        mean = [sum(row[k] for row in rows) / len(rows) for k in (1, 2, 3)]
        counts = math.sqrt(sum(m * m for m in mean))
        return [
            scale
            for scale in dict.fromkeys(IMU_SCALES.values())
            if abs(counts * scale[2] / (_GRAVITY * interval) - 1.0) < _MATCH
        ]

    def clean(self, block: bytes) -> bytes:
        """Return the lines with commas after their header, without checksums, other messages."""
        return _CHECKSUM.sub(b"", _OTHER_MESSAGES.sub(b"", block)).replace(b";", b",")


def _signed(gyro: float, accel: float) -> dict[str, float]:
    scale = {f"gyro_{axis}": gyro for axis in "xyz"}
    scale |= {f"accel_{axis}": accel for axis in "xyz"}
    return {**scale, "gyro_y": -gyro, "accel_y": -accel}
