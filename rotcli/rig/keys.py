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


# In the order of docs/reference/rig.md, the figures of a noise analysis after those of a datasheet.
KEYS: dict[str, dict[str, Key]] = {
    "site": {
        "latitude": Key("number", "deg", DEG, -90.0, 90.0),
        "longitude": Key("number", "deg", DEG, -360.0, 360.0),
        "height": Key("number", "m", 1.0, -12000.0, 100000.0),
        "gravity": Key("number", "m/s^2", 1.0, 9.6, 10.0),
        "gravity_sigma": Key("number", "m/s^2", 1.0, 0.0, 0.1, above=True),
    },
    "attitude": {
        "pitch": Key("number", "deg", DEG, -90.0, 90.0),
        "roll": Key("number", "deg", DEG, -180.0, 180.0),
        "azimuth": Key("number", "deg", DEG, -360.0, 360.0),
        "pitch_sigma": Key("number", "deg", DEG, 0.0, 90.0),
        "roll_sigma": Key("number", "deg", DEG, 0.0, 90.0),
        "azimuth_sigma": Key("number", "deg", DEG, 0.0, 180.0, above=True),
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
        "turn_on_sigma": _noise("deg/h", DEG_PER_HOUR),
        "accel_bias_sigma": _noise("m/s^2", 1.0),
        "gyro_range": Key("number", "deg/s", DEG, low=0.0, above=True),
        "accel_range": Key("number", "m/s^2", low=0.0, above=True),
        "mount": Key("mount"),
        "lever_arm": Key("vector", "m", low=-100.0, high=100.0),
        "format": Key("format"),
        "columns": Key("columns", choices=COLUMNS),
        "units": Key("units", choices=("time", "gyro", "accel", "temperature")),
        "delimiter": Key("delimiter"),
        "comment": Key("text"),
        "skip": Key("count"),
    },
    "table": {
        "axis": Key("axis"),
        "axes": Key("axes"),
        "direction": Key("choice", choices=(1, -1)),
        "directions": Key("directions"),
        "column": Key("column"),
        "columns": Key("columns", choices=("time", "angle", "outer", "middle", "inner")),
        "units": Key("table units", choices=("time", "angle")),
        "time_offset": Key("number", "s"),
    },
    "stages": {"static": Key("pair"), "rotation": Key("pairs"), "navigation": Key("pair")},
}

# One table of the list [[mountings]].
MOUNTING_KEYS: dict[str, Key] = {
    "from": Key("number", "s"),
    "to": Key("number", "s"),
    "mount": Key("mount"),
    "sigma": Key("number", "deg", DEG, 0.0, 180.0),
}


def parse_mountings(values: object, path: str) -> list[dict[str, Any]]:
    """Return the tables of [[mountings]], checked and in SI; raises RigError."""
    if not isinstance(values, list) or not all(isinstance(v, Mapping) for v in values):
        raise RigError(f"{path}: mountings: not a list of tables; write each as [[mountings]]")
    found = []
    for number, held in enumerate(values, start=1):
        where = f"{path}: [[mountings]] {number}"
        for name in held:
            if name not in MOUNTING_KEYS:
                advice = f"did you mean {nearest(name, MOUNTING_KEYS)}?"
                raise RigError(f"{where}: {name}: unknown key; {advice}")
        for name in ("from", "to", "mount"):
            if name not in held:
                raise RigError(f"{where}: {name}: missing; give from, to (s) and mount")
        try:
            found.append({name: parse(MOUNTING_KEYS[name], value) for name, value in held.items()})
        except Faulty as fault:
            raise RigError(f"{where}: {fault}") from None
        if found[-1]["from"] >= found[-1]["to"]:
            raise RigError(f"{where}: ends before it starts; give from < to, s")
        if number > 1 and found[-1]["from"] < found[-2]["to"]:
            raise RigError(f"{where}: overlaps the one before; order them in time")
    return found


def parse_sections(values: Mapping[str, Any], path: str) -> dict[str, dict[str, Any]]:
    """Return the sections with every value checked and in SI.

    Raises RigError for an unknown section or key and for an impossible value.
    """
    result: dict[str, dict[str, Any]] = {}
    for section, held in values.items():
        if section == "mountings":  # a list, see parse_mountings
            continue
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
