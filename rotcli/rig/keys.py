"""The sections and keys of rig.toml: what each may hold, and a file's sections checked and in SI.

Every fault is one RigError line: `FILE: [section] key: value: what is allowed`. What a kind of
value is stands in `rig_values`.
"""

from collections.abc import Mapping
from typing import Any

from rotcli.errors import RigError
from rotcli.files.names import nearest
from rotcli.rig.formats import implied
from rotcli.rig.values import COLUMNS, Faulty, Key, parse, show
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR, METRE_PER_SECOND_PER_ROOT_HOUR, PPM


def _noise(unit: str, to_si: float) -> Key:
    return Key("figure", unit, to_si, low=0.0)


# In the order of docs/rig.md, the figures of a noise analysis after those of a datasheet.
KEYS: dict[str, dict[str, Key]] = {
    "site": {
        "latitude": Key("number", "deg", DEG, -90.0, 90.0),
        "longitude": Key("number", "deg", DEG, -360.0, 360.0),
        "height": Key("number", "m", 1.0, -12000.0, 100000.0),
        "gravity": Key("number", "m/s^2", 1.0, 9.6, 10.0),
    },
    "attitude": {
        "pitch": Key("number", "deg", DEG, -90.0, 90.0),
        "roll": Key("number", "deg", DEG, -180.0, 180.0),
        "azimuth": Key("number", "deg", DEG, -360.0, 360.0),
    },
    "imu": {
        "name": Key("text"),
        "sampling": Key("choice", choices=("instant", "average", "increment")),
        "clock": Key("choice", choices=("regular", "stamps")),
        "angle_random_walk": _noise("deg/sqrt(h)", DEG_PER_ROOT_HOUR),
        "bias_instability": _noise("deg/h", DEG_PER_HOUR),
        "velocity_random_walk": _noise("m/s/sqrt(h)", METRE_PER_SECOND_PER_ROOT_HOUR),
        "accel_bias_instability": _noise("m/s^2", 1.0),
        "rate_random_walk": _noise("deg/h/sqrt(s)", DEG_PER_HOUR),
        "gauss_markov_gyro_sigma": _noise("deg/h", DEG_PER_HOUR),
        "gauss_markov_gyro_time": Key("figure", "s", low=0.0, above=True),
        "gauss_markov_accel_sigma": _noise("m/s^2", 1.0),
        "gauss_markov_accel_time": Key("figure", "s", low=0.0, above=True),
        "scale_sigma": _noise("ppm", PPM),
        "gyro_range": Key("number", "deg/s", DEG, low=0.0, above=True),
        "accel_range": Key("number", "m/s^2", low=0.0, above=True),
        "mount": Key("mount"),
        "lever_arm": Key("vector", "m", low=-100.0, high=100.0),
        "format": Key("format"),
        "columns": Key("columns", choices=COLUMNS),
        "units": Key("units", choices=("time", "gyro", "accel")),
        "delimiter": Key("delimiter"),
        "comment": Key("text"),
        "skip": Key("count"),
    },
    "table": {
        "axis": Key("axis"),
        "direction": Key("choice", choices=(1, -1)),
        "column": Key("column"),
        "columns": Key("columns", choices=("time", "angle")),
        "units": Key("table units", choices=("time", "angle")),
        "time_offset": Key("number", "s"),
    },
    "stages": {"static": Key("pair"), "rotation": Key("pairs"), "navigation": Key("pair")},
}


def parse_sections(values: Mapping[str, Any], path: str) -> dict[str, dict[str, Any]]:
    """Return the sections with every value checked and in SI.

    Raises RigError for an unknown section or key and for an impossible value.
    """
    result: dict[str, dict[str, Any]] = {}
    for section, held in values.items():
        if section not in KEYS:
            home = next((s for s in KEYS if section in KEYS[s]), None)
            advice = (
                f"it belongs in [{home}]" if home else f"did you mean [{nearest(section, KEYS)}]?"
            )
            what = "section" if isinstance(held, Mapping) else "key"
            raise RigError(f"{path}: {section}: unknown {what}; {advice}")
        if not isinstance(held, Mapping):
            raise RigError(f"{path}: {section}: not a section; write it as [{section}]")
        result[section] = {}
        for name, value in (implied(held) if section == "imu" else held).items():
            if name not in KEYS[section]:
                advice = f"did you mean {nearest(name, KEYS[section])}?"
                raise RigError(f"{path}: [{section}] {name}: unknown key; {advice}")
            key = KEYS[section][name]
            try:
                result[section][name] = parse(key, value)
            except Faulty as fault:
                raise RigError(f"{path}: [{section}] {name}: {fault}") from None
    if "site" in result and "latitude" not in result["site"]:
        raise RigError(f"{path}: [site] latitude: missing; give it in deg, from -90 to 90")
    _one_angle_column(result.get("table", {}), path)
    return result


def _one_angle_column(table: dict[str, Any], path: str) -> None:
    """Let `columns` name the angle's column as `column` does; both must not differ."""
    angle = table.get("columns", {}).get("angle")
    if angle is None:
        return
    if table.setdefault("column", angle) != angle:
        what = f"{show(table['column'])}, but columns names {show(angle)}; leave one out"
        raise RigError(f"{path}: [table] column: {what}")
