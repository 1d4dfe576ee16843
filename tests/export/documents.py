"""Result documents of a NAV440 with exactly its profile's figures, as the commands write them."""

from copy import deepcopy
from typing import Any

from rotcli import units
from rotcli.export.thermal import Source

AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
RIG = {
    "site": {"latitude": 51.08, "longitude": -114.13, "height": 1100.0, "gravity": 9.8083},
    "imu": {"name": "NAV440", "gyro_range": 400.0},
}
# ppm; rows are sensor axes: the nav440 profile.
MATRIX = ((900.0, 400.0, -1100.0), (-500.0, -600.0, 800.0), (300.0, -350.0, 1200.0))


def quantity(value: float | None, sigma: float | None, unit: str) -> dict[str, Any]:
    return {"value": value, "sigma": sigma, "unit": unit}


def coefficient(value: float | None, unit: str, upper: float | None = None) -> dict[str, Any]:
    return {"value": value, "sigma": None, "unit": unit, "upper": upper, "reason": None}


def axis_noise(axis: str, *, walk: float | None, limit: float | None = None) -> dict[str, Any]:
    if axis.startswith("gyro"):
        terms = {
            "random_walk": coefficient(0.4, "deg/sqrt(h)"),
            "bias_instability": coefficient(15.66, "deg/h"),
            "rate_random_walk": coefficient(walk, "deg/h/sqrt(s)", limit),
        }
    else:
        micro_g = 1e-6 * units.STANDARD_GRAVITY
        terms = {
            "random_walk": coefficient(0.048, "m/s/sqrt(h)"),
            "bias_instability": coefficient(4.5e-4 / micro_g, "ug"),
            "rate_random_walk": coefficient(walk, "ug/sqrt(s)", limit),
        }
    return {"coefficients": terms, "gauss_markov": {"sigma": None, "correlation_time_s": None}}


def allan(
    *, gyro_walk: float | None = 0.35, gyro_limit: float | None = None, rig: Any = RIG
) -> tuple[Source, dict[str, Any]]:
    axes = {
        axis: axis_noise(axis, walk=gyro_walk, limit=gyro_limit)
        if axis.startswith("gyro")
        else axis_noise(axis, walk=None, limit=2.0)
        for axis in AXES
    }
    doc = {"kind": "allan", "schema": 1, "rig": deepcopy(rig), "interval_s": 0.01, "axes": axes}
    return Source("allan.json", "allan", "a" * 64), doc


def triad() -> tuple[Source, dict[str, Any]]:
    biases = {"x": 120.0, "y": -90.0, "z": 60.0}
    parameters = {f"bias_{a}": quantity(v, 1.0, "deg/h") for a, v in biases.items()}
    for a, row in zip("xyz", MATRIX, strict=True):
        for b, value in zip("xyz", row, strict=True):
            parameters[f"Kg{a if a == b else a + b}"] = quantity(value, 20.0, "ppm")
    doc = {
        "kind": "calibration",
        "schema": 1,
        "model": "triad",
        "rig": deepcopy(RIG),
        "parameters": parameters,
    }
    return Source("triad.json", "calibration", "b" * 64), doc


# Set B-1: d = 60 + 400 x - 150 x^2 + 80 x^3 deg/h, K = 900 + 1500 x + 400 x^2 ppm, x = (T - 20)/40.
B1_BIAS = (60.0, 400.0 / 40.0, -150.0 / 40.0**2, 80.0 / 40.0**3)
B1_SCALE = (900.0, 1500.0 / 40.0, 400.0 / 40.0**2)


def thermal(extra: tuple[float, ...] = (), axis: str = "z") -> tuple[Source, dict[str, Any]]:
    """Return a thermal document; extra: higher powers of the bias of gyro x, y, z."""
    channels: dict[str, Any] = {}
    for name in "xyz":
        powers = {
            "bias": {"value": [*B1_BIAS, *extra], "unit": "deg/h/degC^n"},
            "scale": {"value": list(B1_SCALE), "unit": "ppm/degC^n"},
        }
        channels[f"gyro_{name}"] = {
            "powers": powers,
            "left_out_soaks": {"rms": 29.9, "unit": "deg/h", "chi2_per_value": 1.0},
        }
    doc = {
        "kind": "calibration",
        "schema": 1,
        "model": "thermal",
        "axis": axis,
        "rig": deepcopy(RIG),
        "temperature": {"low": -20.0, "high": 60.0, "reference": 20.0, "unit": "degC"},
        "parameters": {},
        "channels": channels,
    }
    return Source("thermal.json", "calibration", "c" * 64), doc
