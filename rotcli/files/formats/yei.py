"""YEI (Yost Labs) 3-Space sensors: the log of the 3-Space Suite."""

import re
from typing import Any

from rotcli.files.formats.base import Head, LogFormat

_FIELD = re.compile(r"%\w+\((\w+)\)")
_UNITS = {"ChipTimeUS": "us", "ChipTimeMS": "ms"}


class ThreeSpace(LogFormat):
    """Values with commas below `# Data format: "%int(ChipTimeUS),%float(RawGyroX),…"`."""

    name = "3-space"
    title = "YEI 3-Space log"
    source = "YEI Technology, 3-Space Sensor User's Manual (gyros rad/s, accelerometers g)"
    rig = {"units": {"gyro": "rad/s", "accel": "g"}, "delimiter": ","}
    pattern = r"\A\s*#\s*Data format:\s*\"?%"
    wraps = (1 << 32,)

    def rig_defaults(self, head: Head) -> dict[str, Any]:
        """Return the keys for one file: the columns that its head names, raw or corrected."""
        names = _FIELD.findall(",".join(head.names))
        found: dict[str, Any] = {**self.rig, "units": dict(self.rig["units"]), "columns": {}}
        for k, name in enumerate(names, start=1):
            if name in _UNITS:
                found["columns"]["time"] = k
                found["units"]["time"] = _UNITS[name]
            match = re.fullmatch(r"(?:Raw|Corrected)?(Gyro|Accel)([XYZ])", name)
            if match:
                channel = f"{match[1].lower()}_{match[2].lower()}"
                found["columns"].setdefault(channel, k)
        return found
