"""Noise figures as keys of a rig's [imu] table."""

import math
import tomllib
from pathlib import Path

from rotcli import units
from rotcli.allan.estimate import AllanResult
from rotcli.errors import RigError
from rotcli.files.atomic import atomic_write
from rotcli.files.text import read_text
from rotcli.lazy import lazily
from rotcli.rig.rig import rig_from_dict

with lazily():
    import tomlkit

# Rig key: kind of axis, coefficient (None for the Gauss-Markov figures), unit, its size in SI.
_RIG = {
    "angle_random_walk": ("gyro", "random_walk", "deg/sqrt(h)", units.DEG_PER_ROOT_HOUR),
    "bias_instability": ("gyro", "bias_instability", "deg/h", units.DEG_PER_HOUR),
    "rate_random_walk": ("gyro", "rate_random_walk", "deg/h/sqrt(s)", units.DEG_PER_HOUR),
    "velocity_random_walk": (
        "accel",
        "random_walk",
        "m/s/sqrt(h)",
        units.METRE_PER_SECOND_PER_ROOT_HOUR,
    ),
    "accel_bias_instability": ("accel", "bias_instability", "m/s^2", 1.0),
    "gauss_markov_gyro_sigma": ("gyro", "sigma", "deg/h", units.DEG_PER_HOUR),
    "gauss_markov_gyro_time": ("gyro", "time", "s", 1.0),
    "gauss_markov_accel_sigma": ("accel", "sigma", "m/s^2", 1.0),
    "gauss_markov_accel_time": ("accel", "time", "s", 1.0),
}


def rig_figures(result: AllanResult) -> dict[str, float | list[float]]:
    """Return what a rig's [imu] can hold of the result, in the rig's units, four digits.

    A list of x, y, z where all three axes have the figure; their root mean square where only
    some have; nothing where none has.
    """
    figures: dict[str, float | list[float]] = {}
    for key, (kind, name, _, size) in _RIG.items():
        values = []
        for axis in "xyz":
            noise = result.axes.get(f"{kind}_{axis}")
            if noise is None:
                continue
            if name in ("sigma", "time"):
                value = getattr(noise.gauss_markov, name)
            else:
                value = noise.fit.coefficients[name].value
            if value is not None:
                values.append(float(f"{value / size:.4g}"))
        if len(values) == 3:
            figures[key] = values
        elif values:
            figures[key] = float(f"{math.sqrt(sum(v * v for v in values) / len(values)):.4g}")
    return figures


def write_to_rig(path: str, result: AllanResult) -> dict[str, float | list[float]]:
    """Write the measured figures into the [imu] table of a rig file; return what was written.

    Comments, order and every other key stay; a figure the record does not give stays as it was.
    A file that is not there is made.

    Raises RigError when the file cannot be read or written, or would not be a rig.
    """
    figures = rig_figures(result)
    place = Path(path)
    try:
        text = read_text(place) if place.exists() else ""
        document = tomlkit.parse(text)
    except OSError as fault:
        raise RigError(f"{path}: cannot be read: {fault.strerror or fault}") from fault
    except (UnicodeDecodeError, tomlkit.exceptions.TOMLKitError) as fault:
        raise RigError(f"{path}: not TOML: {fault}; correct the file") from fault
    imu = document.setdefault("imu", tomlkit.table())
    if not isinstance(imu, dict):
        raise RigError(f"{path}: imu: {imu!r} is not a table; correct the file")
    for key, value in figures.items():
        known = key in imu
        imu[key] = value
        if not known and isinstance(imu, tomlkit.items.Table):
            imu[key].comment(f"{_RIG[key][2]}, measured")
    written = tomlkit.dumps(document)
    rig_from_dict(tomllib.loads(written), path)
    try:
        with atomic_write(place) as stream:
            stream.write(written.encode())
    except OSError as fault:
        raise RigError(f"{path}: cannot be written: {fault.strerror or fault}") from fault
    return figures
