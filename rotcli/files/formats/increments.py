"""Text of integrated navigation programs: increments of KF-GINS and PSINS."""

from typing import Any

from rotcli.errors import LogError
from rotcli.files.channels import AXES
from rotcli.files.formats.base import FORWARD_RIGHT_DOWN, Head, LogFormat, columns
from rotcli.units import STANDARD_GRAVITY, UNITS


class KfGins(LogFormat):
    """KF-GINS increments, seven columns without a header; axes forward, right, down."""

    name = "kf-gins"
    title = "KF-GINS increments text"
    source = "github.com/i2Nav-WHU/KF-GINS, README 2.1 (frames), 2.2 (data format)"
    rig = {
        "columns": columns(1, 2, 3, 4, 5, 6, 7),
        "units": {"time": "s", "gyro": "rad", "accel": "m/s"},
        "delimiter": " ",
        "sampling": "increment",
        "mount": FORWARD_RIGHT_DOWN,
    }


class Psins(LogFormat):
    """PSINS .imu text: three lines of numbers, then integer increments.

    The second line contains latitude, longitude, height, start (s), interval (ms) and gravity
    (m/s^2), the third the scale factors of the gyros (arcsec) and of the accelerometers (ug s).
    A seventh column corrects the interval of each record; it is written in us, though the
    comment in its header says ms.
    """

    name = "psins"
    title = "PSINS .imu text"
    source = "Yan Gongmin, PSINS toolbox, imufile.m"
    rig = {
        "columns": dict(zip(AXES, range(1, 7), strict=True)),
        "units": {"gyro": "rad", "accel": "m/s"},
        "delimiter": " ",
        "comment": "%",
        "sampling": "increment",
    }
    pattern = r"\A%.*PSINS"
    head_lines = 3

    def rig_defaults(self, head: Head) -> dict[str, Any]:
        """Return the keys for one file: its start, interval and scale factors."""
        for line, values in head.values:
            if len(values) < 6:
                finding = f"{len(values)} numbers in the head, 6 expected; is this a PSINS log?"
                raise LogError(head.path, finding, row=line)
        (line, (_, _, _, start, interval, gravity, *_)), (last, scales) = head.values[1:]
        if not interval > 0.0:
            finding = f"the interval is {interval:g} ms; correct the head of the log"
            raise LogError(head.path, finding, row=line)
        if not all(scale > 0.0 for scale in scales[:6]):
            finding = "a scale factor is not above 0; correct the head of the log"
            raise LogError(head.path, finding, row=last)
        g = gravity if gravity > 0.0 else STANDARD_GRAVITY
        arcsec = UNITS["angle"]["arcsec"]
        factors = [*(s * arcsec for s in scales[:3]), *(s * 1e-6 * g for s in scales[3:6])]
        return {
            **self.rig,
            "scale": dict(zip(AXES, factors, strict=True)),
            "start": start,
            "interval": interval * 1e-3,
            "interval_correction": len(AXES) if len(head.records[0]) > len(AXES) else None,
        }
