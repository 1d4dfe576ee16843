"""The sections and keys of rig.toml: kind, unit and limits of each.

`[imu]`, `[table]` and `[reference]` share the keys that describe a log (`LOG_KEYS`). Each error is
one RigError line: `FILE: [section] key: finding; allowed values`.
"""

from collections.abc import Mapping
from typing import Any

from rotcli.errors import RigError
from rotcli.files.channels import IMU_CHANNELS, REFERENCE_CHANNELS, TABLE_CHANNELS, Channel
from rotcli.files.formats import FORMATS, FRAMES
from rotcli.files.names import suggest
from rotcli.files.toml_schema import MAX_TIME, InvalidValue, Key, show
from rotcli.rig.values import parse
from rotcli.units import DEG, DEG_PER_HOUR, DEG_PER_ROOT_HOUR, METRE_PER_SECOND_PER_ROOT_HOUR, PPM

MAX_SKIPPED_LINES = 100_000
MAX_CLOCK_RATE = 50_000.0  # ppm: clocks that differ by more count another unit
# No sensor has larger figures; values beyond them are slips of the unit or of the exponent.
MAX_RATE = 1e5  # deg/s
MAX_ACCEL = 1e5  # m/s^2
MAX_CORRELATION = 1e9  # s, 30 years
_MAX_NOISE = {  # of figures, in their unit
    "deg/sqrt(h)": 1e4,
    "deg/h": 1e7,
    "m/s/sqrt(h)": 1e4,
    "m/s^2": 1e3,
    "deg/h/sqrt(s)": 1e7,
    "ppm": 1e6,
}
_MAX_SCALE = 1e20  # of raw counts: 64 bits


def _noise(unit: str, to_si: float) -> Key:
    return Key("figure", unit, to_si, low=0.0, high=_MAX_NOISE[unit])


def _time() -> Key:
    return Key("figure", "s", low=0.0, above=True, high=MAX_CORRELATION)


def _groups(channels: tuple[Channel, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(c.group for c in channels))


def _log_keys(channels: tuple[Channel, ...], more: tuple[str, ...] = ()) -> dict[str, Key]:
    """Return the keys that describe how a log of these channels is written."""
    names, groups = tuple(c.name for c in channels), _groups(channels)
    either = tuple(dict.fromkeys((*groups, *names)))
    return {
        "format": Key("format"),
        "columns": Key("columns", choices=("time", *names, *more)),
        "units": Key("units", choices=("time", *groups)),
        "scale": Key("scale", low=-_MAX_SCALE, high=_MAX_SCALE, choices=either),
        "offset": Key("offset", low=-_MAX_SCALE, high=_MAX_SCALE, choices=either),
        "clock": Key("choice", choices=("regular", "stamps", "count")),
        "rate": Key("number", "Hz", low=0.0, high=1e6, above=True),
        "delimiter": Key("delimiter"),
        "decimal": Key("choice", choices=(".", ",")),
        "comment": Key("text"),
        "skip": Key("count", high=MAX_SKIPPED_LINES),
        "encoding": Key("encoding"),
        "instance": Key("instance"),
        "topic": Key("text"),
    }


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
        "sampling": Key("sampling", choices=("instant", "average", "increment")),
        "clock": Key("choice"),  # its place in the file; `_log_keys` defines it
        "angle_random_walk": _noise("deg/sqrt(h)", DEG_PER_ROOT_HOUR),
        "bias_instability": _noise("deg/h", DEG_PER_HOUR),
        "velocity_random_walk": _noise("m/s/sqrt(h)", METRE_PER_SECOND_PER_ROOT_HOUR),
        "accel_bias_instability": _noise("m/s^2", 1.0),
        "rate_random_walk": _noise("deg/h/sqrt(s)", DEG_PER_HOUR),
        "gauss_markov_gyro_sigma": _noise("deg/h", DEG_PER_HOUR),
        "gauss_markov_gyro_time": _time(),
        "gauss_markov_accel_sigma": _noise("m/s^2", 1.0),
        "gauss_markov_accel_time": _time(),
        "scale_sigma": _noise("ppm", PPM),
        "turn_on_sigma": _noise("deg/h", DEG_PER_HOUR),
        "accel_bias_sigma": _noise("m/s^2", 1.0),
        "gyro_range": Key("number", "deg/s", DEG, low=0.0, high=MAX_RATE, above=True),
        "accel_range": Key("number", "m/s^2", low=0.0, high=MAX_ACCEL, above=True),
        "mount": Key("mount"),
        "frame": Key("frame"),
        "lever_arm": Key("vector", "m", low=-100.0, high=100.0),
        "reports_gravity": Key("switch"),
        "channels": Key(
            "channels", choices=(*_groups(IMU_CHANNELS), *(c.name for c in IMU_CHANNELS))
        ),
        "accel_log": Key("text"),
        **_log_keys(IMU_CHANNELS),
    },
    "table": {
        "axis": Key("axis"),
        "axes": Key("axes"),
        "direction": Key("choice", choices=(1, -1)),
        "directions": Key("directions"),
        "column": Key("column"),
        "quantity": Key("choice", choices=("angle", "rate")),
        "columns": Key("columns"),
        "units": Key("units"),
        "counts_per_turn": Key("number", low=0.0, high=1e12, above=True),
        "wrap": Key("number", "deg", DEG, low=0.0, high=1e9, above=True),
        "time_offset": Key("number", "s", low=-MAX_TIME, high=MAX_TIME),
        "clock_rate": Key("number", "ppm", PPM, -MAX_CLOCK_RATE, MAX_CLOCK_RATE),
        **_log_keys(TABLE_CHANNELS, ("outer", "middle", "inner")),
    },
    "reference": _log_keys(REFERENCE_CHANNELS),
    "stages": {"static": Key("pair"), "rotation": Key("pairs"), "navigation": Key("pair")},
}

# One table of the list [[mountings]].
MOUNTING_KEYS: dict[str, Key] = {
    "from": Key("number", "s", low=-MAX_TIME, high=MAX_TIME),
    "to": Key("number", "s", low=-MAX_TIME, high=MAX_TIME),
    "mount": Key("mount"),
    "sigma": Key("number", "deg", DEG, 0.0, 180.0),
}


def parse_mountings(values: object, path: str) -> list[dict[str, Any]]:
    """Return the tables of [[mountings]], checked and in SI; raises RigError."""
    if not isinstance(values, list) or not all(isinstance(v, Mapping) for v in values):
        raise RigError(f"{path}: mountings: not a list of tables; write each as [[mountings]]")
    found: list[dict[str, Any]] = []
    for count, keys in enumerate(values, start=1):
        where = f"{path}: [[mountings]] {count}"
        for name in keys:
            if name not in MOUNTING_KEYS:
                advice = suggest(name, MOUNTING_KEYS)
                raise RigError(f"{where}: {name}: unknown key; {advice}")
        for name in ("from", "to", "mount"):
            if name not in keys:
                raise RigError(f"{where}: {name}: missing; write from, to (s) and mount")
        found.append({})
        for name, value in keys.items():
            try:
                found[-1][name] = parse(MOUNTING_KEYS[name], value)
            except InvalidValue as error:
                raise RigError(f"{where}: {name}: {error}") from None
        if found[-1]["from"] >= found[-1]["to"]:
            raise RigError(f"{where}: ends before it starts; write from < to, s")
        if count > 1 and found[-1]["from"] < found[-2]["to"]:
            raise RigError(f"{where}: overlaps the one before; order them in time")
    return found


def format_defaults(imu: Mapping[str, Any]) -> dict[str, Any]:
    """Return [imu] keys with the sampling and mount of their format, and of their frame."""
    named = FORMATS.get(str(imu.get("format")))
    rig = named.rig if named else {}
    settled = {key: rig[key] for key in ("sampling", "mount") if key in rig}
    if str(imu.get("frame")) in FRAMES and "mount" not in imu:  # a mount as well is an error
        settled["mount"] = FRAMES[str(imu["frame"])]
        imu = {key: value for key, value in imu.items() if key != "frame"}
    return {**settled, **imu}


def parse_sections(values: Mapping[str, Any], path: str) -> dict[str, dict[str, Any]]:
    """Return the sections with every value checked and in SI.

    Raises RigError for an unknown section or key and for an invalid value.
    """
    result: dict[str, dict[str, Any]] = {}
    for section, keys in values.items():
        if section == "mountings":  # a list, see parse_mountings
            continue
        if section == "unit":
            result[section] = _free_texts(path, keys)
            continue
        if section not in KEYS:
            home = next((s for s in KEYS if section in KEYS[s]), None)
            advice = f"it belongs in [{home}]" if home else suggest(section, (*KEYS, "unit"))
            kind = "section" if isinstance(keys, Mapping) else "key"
            raise RigError(f"{path}: {section}: unknown {kind}; {advice}")
        if not isinstance(keys, Mapping):
            raise RigError(f"{path}: {section}: not a section; write it as [{section}]")
        result[section] = {}
        for name, value in (format_defaults(keys) if section == "imu" else keys).items():
            if name not in KEYS[section]:
                advice = suggest(name, KEYS[section])
                raise RigError(f"{path}: [{section}] {name}: unknown key; {advice}")
            try:
                result[section][name] = parse(KEYS[section][name], value)
            except InvalidValue as error:
                raise RigError(f"{path}: [{section}] {name}: {error}") from None
    if "site" in result and "latitude" not in result["site"]:
        raise RigError(f"{path}: [site] latitude: missing; write it in deg, -90 to 90")
    if "frame" in result.get("imu", {}):
        raise RigError(f"{path}: [imu] frame: mount is set too; remove one of them")
    _unite_angle_columns(result.get("table", {}), path)
    return result


def _free_texts(path: str, keys: object) -> dict[str, Any]:
    """Return [unit]: the names, dates and remarks of the device, any keys."""
    if not isinstance(keys, Mapping):
        raise RigError(f"{path}: unit: not a section; write it as [unit]")
    for name, value in keys.items():
        if isinstance(value, Mapping | list):
            finding = f"{show(value)} is not a text, number or date"
            raise RigError(f"{path}: [unit] {name}: {finding}; write one value")
    return {
        name: value if isinstance(value, str | int | float) else str(value)
        for name, value in keys.items()
    }


def _unite_angle_columns(table: dict[str, Any], path: str) -> None:
    """Let `columns` name the column of the angle as `column` does; both must agree."""
    angle = table.get("columns", {}).get("angle")
    if angle is None:
        return
    if table.setdefault("column", angle) != angle:
        finding = f"{show(table['column'])}, but columns names {show(angle)}; remove one of them"
        raise RigError(f"{path}: [table] column: {finding}")
