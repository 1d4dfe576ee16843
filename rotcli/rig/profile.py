"""IMU profiles: the sensor errors that a simulation puts in, read from TOML.

Installed ones (`mti-g`, `nav440`, `ideal`) lie in rotcli/data; a path names a user's own.
Units at this door: deg/h, deg/sqrt(h), deg/h/sqrt(s) for gyros, m/s^2, m/s/sqrt(h),
m/s^2/sqrt(s) for accelerometers, ppm for matrices.
"""

from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli import units
from rotcli.errors import RigError
from rotcli.files.text import parse_toml, read_text
from rotcli.files.toml_schema import check_keys, check_number, check_three

Array = NDArray[np.float64]

_NOISE_KEYS = {
    "gyro": {
        "angle_random_walk": ("white", units.DEG_PER_ROOT_HOUR),
        "bias_instability": ("bias_instability", units.DEG_PER_HOUR),
        "rate_random_walk": ("rate_random_walk", units.DEG_PER_HOUR),
        "rate_ramp": ("rate_ramp", units.DEG_PER_HOUR / units.HOUR),
        "quantization": ("quantization", units.DEG / 3600.0),
        "markov_sigma": ("markov_sigma", units.DEG_PER_HOUR),
        "markov_time": ("markov_time", 1.0),
    },
    "accel": {
        "velocity_random_walk": ("white", units.METRE_PER_SECOND_PER_ROOT_HOUR),
        "bias_instability": ("bias_instability", 1.0),
        "rate_random_walk": ("rate_random_walk", 1.0),
        "rate_ramp": ("rate_ramp", 1.0 / units.HOUR),
        "quantization": ("quantization", 1.0),
        "markov_sigma": ("markov_sigma", 1.0),
        "markov_time": ("markov_time", 1.0),
    },
}
_BIAS_UNIT = {"gyro": units.DEG_PER_HOUR, "accel": 1.0}
_RANGE_UNIT = {"gyro": units.DEG, "accel": 1.0}
_OTHER_KEYS = ("range", "datasheet_bias_instability", "bias", "scale", "installation")
_PAIRS = ("xy", "xz", "yx", "yz", "zx", "zy")


@dataclass(frozen=True, eq=False)
class Triad:
    """One triad of a profile, SI.

    bias: (3,); matrix: (3, 3) scale factors and installation errors; noise: the figures of each
    axis by the names of `rotcli.models.sensors.NoiseFigures`; range: None where unlimited.
    """

    bias: Array
    matrix: Array
    noise: dict[str, float]
    range: float | None


@dataclass(frozen=True, eq=False)
class Profile:
    """An IMU as a simulation needs it; rate in Hz."""

    name: str
    rate: float
    gyro: Triad
    accel: Triad


def installed_profiles() -> list[str]:
    """Return the names of the installed profiles."""
    folder = resources.files("rotcli") / "data" / "profiles"
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith("toml"))


def read_profile(name: str) -> Profile:
    """Return the installed profile of that name, or the one in that TOML file.

    Raises RigError for a name that is neither, and for keys and values that make no sense.
    """
    if name in installed_profiles():
        source = resources.files("rotcli") / "data" / "profiles" / f"{name}.toml"
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
    return Profile(
        name=str(data.get("name", name)),
        rate=check_number(name, "rate", data.get("rate", 100.0), positive=True),
        gyro=_triad(name, "gyro", data.get("gyro", {})),
        accel=_triad(name, "accel", data.get("accel", {})),
    )


def _triad(path: str, triad: str, table: dict[str, Any]) -> Triad:
    noise_keys = _NOISE_KEYS[triad]
    check_keys(path, f"[{triad}] ", table, (*noise_keys, *_OTHER_KEYS))
    figures = {
        field: unit
        * check_number(path, f"[{triad}] {key}", table[key], positive=key != "rate_ramp")
        for key, (field, unit) in noise_keys.items()
        if key in table
    }
    matrix = np.diag(check_three(path, f"[{triad}] scale", table.get("scale", [0.0] * 3)))
    installation = table.get("installation", {})
    check_keys(path, f"[{triad}] installation ", installation, _PAIRS)
    for pair, value in installation.items():
        row, column = ("xyz".index(letter) for letter in pair)
        matrix[row, column] = check_number(path, f"[{triad}] installation {pair}", value)
    limit = table.get("range")
    return Triad(
        bias=_BIAS_UNIT[triad] * check_three(path, f"[{triad}] bias", table.get("bias", [0.0] * 3)),
        matrix=units.PPM * matrix,
        noise=figures,
        range=None
        if limit is None
        else _RANGE_UNIT[triad] * check_number(path, f"[{triad}] range", limit, positive=True),
    )
