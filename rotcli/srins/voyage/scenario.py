"""Scenarios of a single-axis rotation INS on a slowly moving vehicle, from a TOML file.

    scenario = "srins"
    seed = 0
    duration = 34.0              # h
    rate = 10.0                  # Hz, 1 to 100

    [site]                       # where the voyage starts; height 0
    latitude = 42.3              # deg
    longitude = 0.0

    [vehicle]
    v_east = 1.0                 # m/s
    v_north = 0.0
    azimuth = 0.0                # deg, clockwise from north, kept

    [rotation]
    rate = 6.0                   # deg/s
    dwell = 60.0                 # s
    kind = "one-stop"            # one-stop, two-stop (0 and 180 deg), still

    [gyro]
    bias = [0.003, 0.003, 0.003] # deg/h
    angle_random_walk = 0.0005   # deg/sqrt(h)
    scale = 10.0                 # ppm, all three axes
    installation = 2.0           # arcsec, all six elements

    [accel]
    bias = [20.0, 20.0, 20.0]    # ug
    noise = 1.0                  # ug/sqrt(Hz)
    scale = 10.0
    installation = 2.0

    [gnss]
    rate = 1.0                   # Hz
    velocity = 0.01              # m/s
    position = 10.0              # m
    outages = []                 # h, [[start, end], ...]

    [doppler]
    rate = 1.0                   # Hz
    noise = 0.1                  # m/s

    [alignment]                  # error of the initial attitude in the rig, arcsec
    pitch = 0.0
    roll = 0.0
    azimuth = 0.0

    [[maneuver]]                 # as many as wanted
    start = 28.5                 # h
    duration = 20.0              # s
    a_east = 0.1                 # m/s^2
    a_north = 0.0
    doppler = "follows"          # follows, frozen (until the end of it), held (from then on)

Every key is optional; the values above are the defaults (without a maneuver).
"""

from dataclasses import field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rotcli import units
from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.files.text import parse_toml, read_text
from rotcli.files.toml_schema import Key, check_keys, check_number, check_numbers, check_seed
from rotcli.rig.profile import Triad
from rotcli.units import FloatArray

NAME = "srins"
SCENARIOS = Path(__file__).parents[2] / "data" / "scenarios"
MICRO_G = units.UNITS["acceleration"]["ug"]
ARCSEC = units.UNITS["angle"]["arcsec"]
Follow = Literal["follows", "frozen", "held"]
_FOLLOW = ("follows", "frozen", "held")
KINDS = ("one-stop", "two-stop", "still")


def _key(unit: str, factor: float, low: float, high: float, *, above: bool = False) -> Key:
    return Key("number", unit, factor, low, high, above)


_ANGLE = _key("deg", units.DEG, -360.0, 360.0)
_SMALL_ANGLE = _key("arcsec", ARCSEC, -1e5, 1e5)
_SPEED = _key("m/s", 1.0, -300.0, 300.0)
_SCALE = _key("ppm", units.PPM, -1e5, 1e5)
_RECORDS = _key("Hz", 1.0, 0.0, 100.0, above=True)
# Section: key: default in the file's unit, and the key with its limits.
NUMBERS: dict[str, dict[str, tuple[float, Key]]] = {
    "": {
        "duration": (34.0, _key("h", units.HOUR, 0.0, 1000.0, above=True)),
        "rate": (10.0, _key("Hz", 1.0, 1.0, 100.0)),
    },
    "site": {
        "latitude": (42.3, _key("deg", units.DEG, -90.0, 90.0)),
        "longitude": (0.0, _ANGLE),
    },
    "vehicle": {"v_east": (1.0, _SPEED), "v_north": (0.0, _SPEED), "azimuth": (0.0, _ANGLE)},
    "rotation": {
        "rate": (6.0, _key("deg/s", units.DEG, 0.0, 1000.0, above=True)),
        "dwell": (60.0, _key("s", 1.0, 0.0, 1e6)),
    },
    "gyro": {
        "angle_random_walk": (0.0005, _key("deg/sqrt(h)", units.DEG_PER_ROOT_HOUR, 0.0, 100.0)),
        "scale": (10.0, _SCALE),
        "installation": (2.0, _SMALL_ANGLE),
    },
    "accel": {
        "noise": (1.0, _key("ug/sqrt(Hz)", MICRO_G, 0.0, 1e6)),
        "scale": (10.0, _SCALE),
        "installation": (2.0, _SMALL_ANGLE),
    },
    "gnss": {
        "rate": (1.0, _RECORDS),
        "velocity": (0.01, _key("m/s", 1.0, 0.0, 1e3)),
        "position": (10.0, _key("m", 1.0, 0.0, 1e6)),
    },
    "doppler": {"rate": (1.0, _RECORDS), "noise": (0.1, _key("m/s", 1.0, 0.0, 1e3))},
    "alignment": {
        "pitch": (0.0, _SMALL_ANGLE),
        "roll": (0.0, _SMALL_ANGLE),
        "azimuth": (0.0, _SMALL_ANGLE),
    },
    "maneuver": {
        "start": (0.0, _key("h", units.HOUR, 0.0, 1000.0)),
        "duration": (20.0, _key("s", 1.0, 0.0, 1e6)),
        "a_east": (0.0, _key("m/s^2", 1.0, -100.0, 100.0)),
        "a_north": (0.0, _key("m/s^2", 1.0, -100.0, 100.0)),
    },
}
BIASES = {
    "gyro": (0.003, _key("deg/h", units.DEG_PER_HOUR, -1e4, 1e4)),
    "accel": (20.0, _key("ug", MICRO_G, -1e6, 1e6)),
}
_OUTAGE = _key("h", units.HOUR, -1000.0, 1000.0)
_WHITE = {"gyro": "angle_random_walk", "accel": "noise"}
_MORE = {
    "": ("scenario", "seed", "maneuver", *(s for s in NUMBERS if s)),
    "rotation": ("kind",),
    "gyro": ("bias",),
    "accel": ("bias",),
    "gnss": ("outages",),
    "maneuver": ("doppler",),
}


@dataclass(frozen=True)
class Maneuver:
    """An acceleration (m/s^2) from `start` for `duration` (s), and what the Doppler log does.

    doppler: `follows` it; `frozen`, the old speed until the end of it; `held`, the old speed from
    then on, as a reference that has lost the bottom.
    """

    start: float
    duration: float
    a_east: float
    a_north: float
    doppler: Follow = "follows"


def _triad(section: str, values: dict[str, float], bias: FloatArray | None = None) -> Triad:
    matrix = np.full((3, 3), values["installation"])
    np.fill_diagonal(matrix, values["scale"])
    each, key = BIASES[section]
    return Triad(
        bias=np.full(3, each * key.factor) if bias is None else bias,
        matrix=matrix,
        noise={"white": values[_WHITE[section]]},
        range=None,
    )


def _defaults(section: str) -> dict[str, float]:
    return {name: value * key.factor for name, (value, key) in NUMBERS[section].items()}


@dataclass(frozen=True, eq=False)
class SrinsScenario:
    """Everything that determines a voyage and its logs, SI and radians; the paper's by default.

    rotation_rate: rad/s; dwell: s; rotation_kind: one of KINDS. The triads' noise has `white`,
    rad/sqrt(s) and m/s/sqrt(s); gnss and doppler noises are those of a record.
    alignment: (pitch, roll, azimuth) error of the rig's attitude, rad.
    """

    seed: int = 0
    duration: float = 34.0 * units.HOUR
    rate: float = 10.0
    latitude: float = 42.3 * units.DEG
    longitude: float = 0.0
    v_east: float = 1.0
    v_north: float = 0.0
    azimuth: float = 0.0
    rotation_rate: float = 6.0 * units.DEG
    dwell: float = 60.0
    rotation_kind: str = "one-stop"
    gyro: Triad = field(default_factory=lambda: _triad("gyro", _defaults("gyro")))
    accel: Triad = field(default_factory=lambda: _triad("accel", _defaults("accel")))
    gnss_rate: float = 1.0
    gnss_velocity: float = 0.01
    gnss_position: float = 10.0
    outages: tuple[tuple[float, float], ...] = ()
    doppler_rate: float = 1.0
    doppler_noise: float = 0.1
    alignment: tuple[float, float, float] = (0.0, 0.0, 0.0)
    maneuvers: tuple[Maneuver, ...] = ()
    source: dict[str, Any] = field(default_factory=lambda: {"scenario": NAME})

    @property
    def interval(self) -> float:
        """The IMU's sample interval, s."""
        return 1.0 / self.rate


def read_srins_scenario(path: str) -> SrinsScenario:
    """Read a scenario file, or a shipped scenario by its name; raises RigError.

    `srins` is the cruise of S; `srins-early`, `srins-late` and `srins-follows` its maneuvers.
    """
    shipped = SCENARIOS / f"{path}.toml"
    file = shipped if shipped.parent == SCENARIOS and shipped.is_file() else Path(path)
    try:
        data = {} if path == NAME else parse_toml(read_text(file))
    except (OSError, ValueError) as fault:
        text = getattr(fault, "strerror", None) or fault
        raise RigError(f"{path}: cannot be read: {text}") from fault
    return scenario_from_dict(data, path)


def scenario_from_dict(data: dict[str, Any], path: str = NAME) -> SrinsScenario:
    """Return the scenario of a dictionary with the file's sections, keys and units.

    Raises RigError for an unknown key and for a value that is out of range.
    """
    check_keys(path, "", data, ("duration", "rate", *_MORE[""]))
    numbers = {
        section: _section(path, section, data.get(section, {})) for section in NUMBERS if section
    }
    top = _section(path, "", {k: v for k, v in data.items() if k in NUMBERS[""]})
    maneuvers = data.get("maneuver", [])
    if not isinstance(maneuvers, list):
        raise RigError(f"{path}: maneuver: write it as [[maneuver]]")
    latitude = numbers["site"]["latitude"]
    if abs(latitude) > 85.0 * units.DEG:
        raise RigError(
            f"{path}: [site] latitude: {latitude / units.DEG:g} is too near a pole for east and "
            "north; allowed: -85 to 85 deg"
        )
    kind = data.get("rotation", {}).get("kind", "one-stop")
    if kind not in KINDS:
        raise RigError(f"{path}: [rotation] kind: {kind!r} is none of {', '.join(KINDS)}")
    seed = check_seed(path, data.get("seed", 0))
    site, vehicle, rotation = numbers["site"], numbers["vehicle"], numbers["rotation"]
    triads = {}
    for name, (_, key) in BIASES.items():
        bias = data.get(name, {}).get("bias")
        given = None if bias is None else check_numbers(path, f"[{name}] bias", key, bias, 3)
        triads[name] = _triad(name, numbers[name], given)
    return SrinsScenario(
        seed=seed,
        duration=top["duration"],
        rate=top["rate"],
        latitude=site["latitude"],
        longitude=site["longitude"],
        v_east=vehicle["v_east"],
        v_north=vehicle["v_north"],
        azimuth=vehicle["azimuth"],
        rotation_rate=rotation["rate"],
        dwell=rotation["dwell"],
        rotation_kind=kind,
        gyro=triads["gyro"],
        accel=triads["accel"],
        gnss_rate=numbers["gnss"]["rate"],
        gnss_velocity=numbers["gnss"]["velocity"],
        gnss_position=numbers["gnss"]["position"],
        outages=_outages(path, data.get("gnss", {}).get("outages", [])),
        doppler_rate=numbers["doppler"]["rate"],
        doppler_noise=numbers["doppler"]["noise"],
        alignment=tuple(numbers["alignment"][key] for key in ("pitch", "roll", "azimuth")),  # type: ignore[arg-type]
        maneuvers=tuple(_maneuver(path, k, m) for k, m in enumerate(maneuvers, start=1)),
        source={**data, "scenario": NAME},
    )


def _section(path: str, section: str, table: Any) -> dict[str, float]:
    """Return the numbers of a section, SI, defaults filled in."""
    place = f"[{section}] " if section else ""
    if section == "maneuver":
        return {}
    check_keys(path, place, table, (*NUMBERS[section], *_MORE.get(section, ())))
    return _values(path, place, section, table)


def _values(path: str, place: str, section: str, table: dict[str, Any]) -> dict[str, float]:
    return {
        name: check_number(path, place + name, key, table.get(name, value))
        for name, (value, key) in NUMBERS[section].items()
    }


def _maneuver(path: str, count: int, table: Any) -> Maneuver:
    place = f"[[maneuver]] {count} "
    check_keys(path, place, table, (*NUMBERS["maneuver"], *_MORE["maneuver"]))
    follow = table.get("doppler", "follows")
    if follow not in _FOLLOW:
        raise RigError(f"{path}: {place}doppler: {follow!r} is none of {', '.join(_FOLLOW)}")
    return Maneuver(**_values(path, place, "maneuver", table), doppler=follow)


def _outages(path: str, value: Any) -> tuple[tuple[float, float], ...]:
    key = "[gnss] outages"
    if not isinstance(value, list) or not all(isinstance(p, list) and len(p) == 2 for p in value):
        raise RigError(f"{path}: {key}: must be a list of [start, end] pairs in hours")
    pairs = [[check_number(path, key, _OUTAGE, item) for item in pair] for pair in value]
    if any(start >= end for start, end in pairs):
        raise RigError(f"{path}: {key}: an outage ends before it starts")
    return tuple((start, end) for start, end in pairs)
