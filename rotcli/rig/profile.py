"""IMU profiles: the sensor errors that a simulation puts in, read from TOML.

Installed ones (`mti-g`, `nav440`, `ideal`) lie in rotcli/data; a path names a user's own.
Units at this door: deg/h, deg/sqrt(h), deg/h/sqrt(s) for gyros, m/s^2, m/s/sqrt(h),
m/s^2/sqrt(s) for accelerometers, ppm for matrices.
"""

from typing import Any

import numpy as np

from rotcli import units
from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.files.installed import DATA
from rotcli.files.text import parse_toml, read_text
from rotcli.files.toml_schema import Key, check_keys, check_number, check_numbers, parse_value
from rotcli.models.reading_effects import NO_EFFECTS, ReadingEffects
from rotcli.units import FloatArray


def _from_zero(unit: str, factor: float, high: float, *, above: bool = False) -> Key:
    return Key("number", unit, factor, 0.0, high, above)


def _signed(unit: str, factor: float, high: float) -> Key:
    return Key("number", unit, factor, -high, high)


# Section: key: name of the field, and the key. Larger figures are slips of unit or exponent.
_NOISE_KEYS: dict[str, dict[str, tuple[str, Key]]] = {
    "gyro": {
        "angle_random_walk": ("white", _from_zero("deg/sqrt(h)", units.DEG_PER_ROOT_HOUR, 1e4)),
        "bias_instability": ("bias_instability", _from_zero("deg/h", units.DEG_PER_HOUR, 1e7)),
        "rate_random_walk": (
            "rate_random_walk",
            _from_zero("deg/h/sqrt(s)", units.DEG_PER_HOUR, 1e7),
        ),
        "rate_ramp": ("rate_ramp", _signed("deg/h/h", units.DEG_PER_HOUR / units.HOUR, 1e7)),
        "quantization": ("quantization", _from_zero("arcsec", units.DEG / 3600.0, 1e7)),
        "markov_sigma": ("markov_sigma", _from_zero("deg/h", units.DEG_PER_HOUR, 1e7)),
        "markov_time": ("markov_time", _from_zero("s", 1.0, 1e9)),
    },
    "accel": {
        "velocity_random_walk": (
            "white",
            _from_zero("m/s/sqrt(h)", units.METRE_PER_SECOND_PER_ROOT_HOUR, 1e4),
        ),
        "bias_instability": ("bias_instability", _from_zero("m/s^2", 1.0, 1e3)),
        "rate_random_walk": ("rate_random_walk", _from_zero("m/s^2/sqrt(s)", 1.0, 1e3)),
        "rate_ramp": ("rate_ramp", _signed("m/s^2/h", 1.0 / units.HOUR, 1e3)),
        "quantization": ("quantization", _from_zero("m/s", 1.0, 1e3)),
        "markov_sigma": ("markov_sigma", _from_zero("m/s^2", 1.0, 1e3)),
        "markov_time": ("markov_time", _from_zero("s", 1.0, 1e9)),
    },
}
_PPM = _signed("ppm", units.PPM, 1e6)
_OTHERS: dict[str, dict[str, Key]] = {
    "gyro": {
        "range": _from_zero("deg/s", units.DEG, 1e5, above=True),
        "datasheet_bias_instability": _from_zero("deg/h", units.DEG_PER_HOUR, 1e7),
        "bias": _signed("deg/h", units.DEG_PER_HOUR, 1e7),
        "scale": _PPM,
        "installation": _PPM,
    },
    "accel": {
        "range": _from_zero("m/s^2", 1.0, 1e5, above=True),
        "datasheet_bias_instability": _from_zero("m/s^2", 1.0, 1e3),
        "bias": _signed("m/s^2", 1.0, 1e3),
        "scale": _PPM,
        "installation": _PPM,
    },
}
# Key: name of the field of `ReadingEffects`, and the key of gyros; accelerometers differ in a unit.
_EFFECTS = {
    "low_pass": _from_zero("Hz", 1.0, 1e5),
    "line_frequency": _from_zero("Hz", 1.0, 1e5),
    "repeats": Key("count", low=1.0, high=1000.0),
}
_LINE_AMPLITUDE = {
    "gyro": _from_zero("deg/s", units.DEG, 1e3),
    "accel": _from_zero("m/s^2", 1.0, 1e3),
}
_RATE = Key("number", "Hz", low=0.01, high=1e5)
_LIMITS = ("range", "datasheet_bias_instability")
_PAIRS = ("xy", "xz", "yx", "yz", "zx", "zy")


@dataclass(frozen=True, eq=False)
class Triad:
    """One triad of a profile, SI.

    bias: (3,); matrix: (3, 3) scale factors and installation errors; noise: the figures of each
    axis by the names of `rotcli.models.sensors.NoiseFigures`; range: None where unlimited;
    effects: filter, line and repeated samples of the logger.
    """

    bias: FloatArray
    matrix: FloatArray
    noise: dict[str, float]
    range: float | None
    effects: ReadingEffects = NO_EFFECTS


@dataclass(frozen=True, eq=False)
class Profile:
    """An IMU as a simulation needs it; rate in Hz."""

    name: str
    rate: float
    gyro: Triad
    accel: Triad


def installed_profiles() -> list[str]:
    """Return the names of the installed profiles."""
    return sorted(file.stem for file in (DATA / "profiles").glob("*.toml"))


def read_profile(name: str) -> Profile:
    """Return the installed profile of that name, or the one in that TOML file.

    Raises RigError for a name that is neither, and for keys and values that make no sense.
    """
    if name in installed_profiles():
        source = DATA / "profiles" / f"{name}.toml"
        text = source.read_text(encoding="utf-8")
    else:
        try:
            text = read_text(name)
        except (OSError, UnicodeDecodeError) as fault:
            known = ", ".join(installed_profiles())
            raise RigError(
                f"{name}: not an installed IMU profile ({known}) and not a readable file"
            ) from fault
    try:
        data = parse_toml(text)
    except ValueError as fault:
        raise RigError(f"{name}: not a TOML file: {fault}; see an installed profile") from fault
    check_keys(name, "", data, ("name", "rate", "gyro", "accel"))
    rate = check_number(name, "rate", _RATE, data.get("rate", 100.0))
    return Profile(
        name=str(data.get("name", name)),
        rate=rate,
        gyro=_triad(name, "gyro", data.get("gyro", {}), rate),
        accel=_triad(name, "accel", data.get("accel", {}), rate),
    )


def _triad(path: str, triad: str, table: dict[str, Any], rate: float) -> Triad:
    noise_keys, others = _NOISE_KEYS[triad], _OTHERS[triad]
    effects = {**_EFFECTS, "line_amplitude": _LINE_AMPLITUDE[triad]}
    check_keys(path, f"[{triad}] ", table, (*noise_keys, *others, *effects))

    def number(name: str, key: Key) -> float:
        return check_number(path, f"[{triad}] {name}", key, table[name])

    def three(name: str) -> FloatArray:
        return check_numbers(path, f"[{triad}] {name}", others[name], table.get(name, [0.0] * 3), 3)

    figures = {
        field: number(name, key) for name, (field, key) in noise_keys.items() if name in table
    }
    matrix = np.diag(three("scale"))
    installation = table.get("installation", {})
    check_keys(path, f"[{triad}] installation ", installation, _PAIRS)
    for pair, value in installation.items():
        row, column = ("xyz".index(letter) for letter in pair)
        place = f"[{triad}] installation {pair}"
        matrix[row, column] = check_number(path, place, others["installation"], value)
    limits = {name: number(name, others[name]) for name in _LIMITS if name in table}
    found = {
        name: parse_value(path, f"[{triad}] {name}", key, table[name])
        for name, key in effects.items()
        if name in table
    }
    effect = ReadingEffects(**found)
    for name, value in (("low_pass", effect.low_pass), ("line_frequency", effect.line_frequency)):
        if value >= 0.5 * rate:
            raise RigError(f"{path}: [{triad}] {name}: {value:g} Hz is half of rate or more")
    return Triad(three("bias"), matrix, figures, limits.get("range"), effect)
