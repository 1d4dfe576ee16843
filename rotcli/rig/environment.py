"""The sections of a scenario about temperature, nonlinearity and warm-up.

[temperature]
profile = [[0, 20], [2400, 60]]   # s, degC: straight lines between the points
lag = 60.0                        # s, of the thermometer behind the sensors
step = 0.1                        # degC, its resolution

[thermal]                         # coefficients of (T - reference)^1, ^2, ...
reference = 20.0                  # degC
gyro_bias = [10.0, -0.09375]      # deg/h/degC^n, all gyros, or one list per gyro
gyro_scale = [37.5, 0.25]         # ppm/degC^n
accel_bias = [1e-4]               # m/s^2/degC^n

[nonlinearity]                    # of every gyro over its input rate x = w / full_scale
full_scale = 100.0                # deg/s
quadratic = 30.0                  # deg/h of x^2
cubic = -60.0                     # deg/h of x^3
asymmetry = 72.0                  # deg/h of |x|
knee = [60.0, 15.0]               # deg/h tanh(w / 15 deg/s)

[warm_up]
amplitude = 200.0                 # deg/h at power-on, decays as exp(-t / time)
time = 300.0                      # s
"""

from typing import Any

import numpy as np

from rotcli.errors import RigError
from rotcli.files.toml_schema import Key, check_keys, check_number
from rotcli.models.laboratory.environment import Environment, RateNonlinearity
from rotcli.units import DEG, DEG_PER_HOUR, PPM, FloatArray

SECTIONS = ("temperature", "thermal", "nonlinearity", "warm_up")
_MAX_ORDER = 5
_TEMPERATURE = Key("number", "degC", low=-273.15, high=2000.0)
_ERROR = Key("number", "deg/h", DEG_PER_HOUR, -1e7, 1e7)
KEYS: dict[str, dict[str, Key]] = {
    "temperature": {
        "time": Key("number", "s", low=-1e7, high=1e7),  # of a point of the profile
        "profile": _TEMPERATURE,
        "lag": Key("number", "s", low=0.0, high=1e5),
        "step": Key("number", "degC", low=0.0, high=100.0),
    },
    "thermal": {
        "reference": _TEMPERATURE,
        "gyro_bias": Key("number", "deg/h/degC^n", DEG_PER_HOUR, -1e7, 1e7),
        "gyro_scale": Key("number", "ppm/degC^n", PPM, -1e6, 1e6),
        "accel_bias": Key("number", "m/s^2/degC^n", low=-1e3, high=1e3),
    },
    "nonlinearity": {
        "full_scale": Key("number", "deg/s", DEG, 0.0, 1e5, above=True),
        "quadratic": _ERROR,
        "cubic": _ERROR,
        "asymmetry": _ERROR,
        "knee": _ERROR,
        "knee rate": Key("number", "deg/s", DEG, 0.0, 1e5, above=True),
    },
    "warm_up": {
        "amplitude": _ERROR,
        "time": Key("number", "s", low=0.0, high=1e7, above=True),
    },
}


def read_environment(path: str, data: dict[str, Any]) -> Environment | None:
    """Remove the sections from a scenario's data and return them; None if there are none."""
    sections = {name: data.pop(name) for name in SECTIONS if name in data}
    if not sections:
        return None
    temperature = sections.get("temperature", {})
    check_keys(path, "[temperature] ", temperature, ("profile", "lag", "step"))
    thermal = sections.get("thermal", {})
    known = ("reference", "gyro_bias", "gyro_scale", "accel_bias")
    check_keys(path, "[thermal] ", thermal, known)
    if thermal and "temperature" not in sections:
        raise RigError(f"{path}: [thermal]: no [temperature] profile; add one")
    warm_up = sections.get("warm_up", {})
    check_keys(path, "[warm_up] ", warm_up, ("amplitude", "time"))
    return Environment(
        temperature=_profile(path, temperature) if "temperature" in sections else None,
        thermometer_lag=_number(path, "temperature", "lag", temperature.get("lag", 0.0)),
        thermometer_step=_number(path, "temperature", "step", temperature.get("step", 0.0)),
        reference=_number(path, "thermal", "reference", thermal.get("reference", 20.0)),
        gyro_bias=_powers(path, "gyro_bias", thermal),
        gyro_scale=_powers(path, "gyro_scale", thermal),
        accel_bias=_powers(path, "accel_bias", thermal),
        nonlinearity=_nonlinearity(path, sections.get("nonlinearity")),
        warm_up=_number(path, "warm_up", "amplitude", warm_up.get("amplitude", 0.0)),
        warm_up_time=_number(path, "warm_up", "time", warm_up.get("time", 300.0)),
    )


def _number(path: str, section: str, name: str, value: Any) -> float:
    return check_number(path, f"[{section}] {name}", KEYS[section][name], value)


def _profile(path: str, table: dict[str, Any]) -> FloatArray:
    """Return the points (p, 2), times increasing."""
    key = "[temperature] profile"
    points = table.get("profile")
    if not isinstance(points, list) or not points:
        raise RigError(f"{path}: {key}: missing; give a list of [s, degC]")
    rows = []
    for point in points:
        if not isinstance(point, list) or len(point) != 2:
            raise RigError(f"{path}: {key}: {point!r} is not [s, degC]")
        time, degrees = point
        check_number(path, key, KEYS["temperature"]["time"], time)
        check_number(path, key, KEYS["temperature"]["profile"], degrees)
        rows.append([float(time), float(degrees)])
    found = np.array(rows)
    if np.any(np.diff(found[:, 0]) < 0.0):
        raise RigError(f"{path}: {key}: the times must not decrease")
    return found


def _powers(path: str, name: str, table: dict[str, Any]) -> FloatArray:
    """Return coefficients (3, q): one list for all three sensors, or a list of three lists."""
    key = f"[thermal] {name}"
    value = table.get(name, [])
    if not isinstance(value, list):
        raise RigError(f"{path}: {key}: must be a list of numbers or three such lists")
    lists = value if value and all(isinstance(v, list) for v in value) else [value] * 3
    if len(lists) != 3 or any(len(one) > _MAX_ORDER for one in lists):
        raise RigError(f"{path}: {key}: three lists of at most {_MAX_ORDER} numbers are allowed")
    found = np.zeros((3, max(len(one) for one in lists)))
    for i, one in enumerate(lists):
        found[i, : len(one)] = [_number(path, "thermal", name, item) for item in one]
    return found


def _nonlinearity(path: str, table: Any) -> RateNonlinearity | None:
    if table is None:
        return None
    known = ("full_scale", "quadratic", "cubic", "asymmetry", "knee")
    check_keys(path, "[nonlinearity] ", table, known)

    def value(key: str) -> float:
        return _number(path, "nonlinearity", key, table.get(key, 0.0))

    knee = table.get("knee", [0.0, 1.0])
    if not isinstance(knee, list) or len(knee) != 2:
        raise RigError(f"{path}: [nonlinearity] knee: must be [deg/h, deg/s]")
    return RateNonlinearity(
        full_scale=_number(path, "nonlinearity", "full_scale", table.get("full_scale", 100.0)),
        quadratic=value("quadratic"),
        cubic=value("cubic"),
        asymmetry=value("asymmetry"),
        knee_height=_number(path, "nonlinearity", "knee", knee[0]),
        knee_rate=_number(path, "nonlinearity", "knee rate", knee[1]),
    )
