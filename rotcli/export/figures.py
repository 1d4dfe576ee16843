"""Figures of one IMU, in SI units, collected from result documents of any kind.

The documents are read by parameter name: `bias_x` in deg/h, `Kgxy` in ppm, and so on. Unknown
parameters are ignored here; a format lists the figures that it cannot contain.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np

from rotcli import units
from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.export.thermal import Source, Thermal, read_thermal
from rotcli.files.results.identity import identity
from rotcli.models.earth import gravity_at
from rotcli.units import FloatArray

GYROS = ("gyro_x", "gyro_y", "gyro_z")
ACCELS = ("accel_x", "accel_y", "accel_z")
REFERENCE_GRAVITY = units.STANDARD_GRAVITY  # m/s^2 per g, of every unit that contains g

# Size in SI of the units of result documents, by kind of quantity.
_UG = 1e-6 * REFERENCE_GRAVITY
_PER_ROOT_HOUR = 1.0 / math.sqrt(units.HOUR)
_SIZES: dict[str, dict[str, float]] = {
    "rate": {"deg/h": units.DEG_PER_HOUR, "deg/s": units.DEG, "rad/s": 1.0},
    "force": {"m/s^2": 1.0, "g": REFERENCE_GRAVITY, "mg": 1e3 * _UG, "ug": _UG},
    "ratio": {"ppm": units.PPM, "1": 1.0},
    "g-sensitivity": {
        "deg/h/g": units.DEG_PER_HOUR / REFERENCE_GRAVITY,
        "deg/h/(m/s^2)": units.DEG_PER_HOUR,
    },
    "second order": {"ug/g^2": 1e-6 / REFERENCE_GRAVITY, "ppm/g": 1e-6 / REFERENCE_GRAVITY},
    "gyro random_walk": {"deg/sqrt(h)": units.DEG_PER_ROOT_HOUR, "rad/s/sqrt(Hz)": 1.0},
    "gyro rate_random_walk": {
        "deg/h/sqrt(s)": units.DEG_PER_HOUR,
        "deg/h/sqrt(h)": units.DEG_PER_HOUR * _PER_ROOT_HOUR,
        "rad/s/sqrt(s)": 1.0,
    },
    "accel random_walk": {
        "m/s/sqrt(h)": units.METRE_PER_SECOND_PER_ROOT_HOUR,
        "ug/sqrt(Hz)": _UG,
        "m/s^2/sqrt(Hz)": 1.0,
    },
    "accel rate_random_walk": {"ug/sqrt(s)": _UG, "m/s^2/sqrt(s)": 1.0},
}
_BIAS_KIND = {"gyro": "rate", "accel": "force"}


@dataclass(frozen=True)
class Level:
    """One noise coefficient in SI: its value, or None and the 95 % upper limit (None: unknown)."""

    value: float | None = None
    upper: float | None = None


@dataclass(frozen=True)
class AxisNoise:
    """Noise of one axis in SI: N, B, K, and the Gauss-Markov process where it was found.

    For a gyro N is in rad/sqrt(s), B in rad/s, K in rad/s/sqrt(s); metres for an accelerometer.
    """

    white: Level = Level()
    flicker: Level = Level()
    walk: Level = Level()
    markov_sigma: float | None = None
    markov_time: float | None = None


@dataclass(frozen=True, eq=False)
class SensorFigures:
    """All that the input documents say about one IMU, SI units; NaN or None where unknown.

    gyro_matrix N, accel_matrix M: (3, 3); g_sensitivity: (3, 3) rad/s per m/s^2; second_order:
    (3,) 1/(m/s^2). rate: Hz; gravity: m/s^2; navigation: s; temperature: degC of the biases.
    """

    name: str | None = None
    serial: str | None = None
    rate: float | None = None
    noise: Mapping[str, AxisNoise] = field(default_factory=dict)
    gyro_bias: FloatArray = field(default_factory=lambda: np.full(3, math.nan))
    accel_bias: FloatArray = field(default_factory=lambda: np.full(3, math.nan))
    gyro_matrix: FloatArray = field(default_factory=lambda: np.full((3, 3), math.nan))
    accel_matrix: FloatArray = field(default_factory=lambda: np.full((3, 3), math.nan))
    g_sensitivity: FloatArray = field(default_factory=lambda: np.full((3, 3), math.nan))
    second_order: FloatArray = field(default_factory=lambda: np.full(3, math.nan))
    thermal: Thermal | None = None
    temperature: float | None = None
    gravity: float | None = None
    gyro_range: float | None = None
    accel_range: float | None = None
    navigation: float | None = None
    mounted: bool = False
    sources: tuple[Source, ...] = ()


def collect(documents: Sequence[tuple[Source, Mapping[str, Any]]]) -> SensorFigures:
    """Return the figures of one IMU from its documents; a later document replaces an earlier one.

    Raises ResultError when the documents name different devices, or one cannot be read.
    """
    figures = SensorFigures(sources=tuple(source for source, _ in documents))
    for source, doc in documents:
        try:
            figures = _add(figures, source, doc)
        except (AttributeError, LookupError, TypeError, ValueError) as fault:
            raise ResultError(
                f"{source.path}: not a valid {source.kind} result ({type(fault).__name__}: "
                f"{str(fault)[:80]}); create it again"
            ) from fault
    return figures


def _add(figures: SensorFigures, source: Source, doc: Mapping[str, Any]) -> SensorFigures:
    figures = _add_identity(figures, source, doc)
    kind = doc["kind"]
    if kind == "allan":
        return _add_noise(figures, source, doc)
    if kind == "calibration":
        figures = _add_parameters(figures, source, doc["parameters"])
        if doc.get("model") == "thermal":
            return replace(figures, thermal=read_thermal(source, doc, figures.thermal))
        return figures
    raise ResultError(f"{source.path}: kind {kind} cannot be exported; use allan or calibration")


def _add_identity(figures: SensorFigures, source: Source, doc: Mapping[str, Any]) -> SensorFigures:
    rig = doc.get("rig") or {}
    imu, site = rig.get("imu") or {}, rig.get("site") or {}
    found = identity(doc)
    name, serial = found.name, found.serial
    for label, known, new in (("name", figures.name, name), ("serial", figures.serial, serial)):
        if known and new and str(known) != str(new):
            raise ResultError(
                f"{source.path}: {label} {new}, but an earlier input has {known}; "
                "export one device at a time"
            )
    span = (rig.get("stages") or {}).get("navigation")
    return replace(
        figures,
        name=figures.name or name,
        serial=figures.serial or serial,
        gravity=_gravity(site) or figures.gravity,
        gyro_range=_scaled(imu.get("gyro_range"), units.DEG) or figures.gyro_range,
        accel_range=_scaled(imu.get("accel_range"), 1.0) or figures.accel_range,
        navigation=float(span[1]) - float(span[0]) if span else figures.navigation,
        mounted=figures.mounted or _is_mounted(imu.get("mount")),
    )


def _gravity(site: Mapping[str, Any]) -> float | None:
    if site.get("gravity"):
        return float(site["gravity"])
    if "latitude" not in site:
        return None
    return gravity_at(units.DEG * float(site["latitude"]), float(site.get("height", 0.0)), None)


def _is_mounted(mount: Any) -> bool:
    return mount is not None and not np.array_equal(np.asarray(mount, dtype=float), np.eye(3))


def _scaled(value: Any, size: float) -> float | None:
    return None if value is None else float(value) * size


def _add_noise(figures: SensorFigures, source: Source, doc: Mapping[str, Any]) -> SensorFigures:
    noise = dict(figures.noise)
    for axis, entry in doc["axes"].items():
        terms, markov = entry["coefficients"], entry.get("gauss_markov") or {}
        sigma, triad = markov.get("sigma"), axis.split("_")[0]
        noise[axis] = AxisNoise(
            white=_level(source, axis, f"{triad} random_walk", terms.get("random_walk")),
            flicker=_level(source, axis, _BIAS_KIND[triad], terms.get("bias_instability")),
            walk=_level(source, axis, f"{triad} rate_random_walk", terms.get("rate_random_walk")),
            markov_sigma=None
            if sigma is None
            else _si(source, axis, _BIAS_KIND[triad], sigma, sigma["value"]),
            markov_time=markov.get("correlation_time_s"),
        )
    interval = doc.get("interval_s")
    rate = 1.0 / float(interval) if interval else figures.rate
    return replace(figures, noise=noise, rate=rate)


def _level(source: Source, axis: str, kind: str, entry: Mapping[str, Any] | None) -> Level:
    if entry is None:
        return Level()
    value, upper = (_si(source, axis, kind, entry, entry.get(key)) for key in ("value", "upper"))
    return Level(value, upper)


def _si(source: Source, name: str, kind: str, entry: Mapping[str, Any], value: Any) -> float | None:
    """Return a value of a quantity in SI; raises ResultError for a unit of another kind."""
    if value is None:
        return None
    unit = str(entry.get("unit"))
    if unit not in _SIZES[kind] or isinstance(value, bool) or not math.isfinite(float(value)):
        raise ResultError(
            f"{source.path}: {name}: {value!r} in {unit!r} is not a {kind}; "
            f"known units: {', '.join(_SIZES[kind])}; create the result again"
        )
    return float(value) * _SIZES[kind][unit]


_KINDS = {
    "gyro_bias": "rate",
    "accel_bias": "force",
    "gyro_matrix": "ratio",
    "accel_matrix": "ratio",
    "g_sensitivity": "g-sensitivity",
    "second_order": "second order",
}


def _add_parameters(
    figures: SensorFigures, source: Source, parameters: Mapping[str, Any]
) -> SensorFigures:
    places = _places()
    arrays = {
        name: getattr(figures, name).copy() for name in {place[0] for place in places.values()}
    }
    for name, entry in parameters.items():
        if name in places and isinstance(entry, Mapping):
            target, index = places[name]
            value = _si(source, name, _KINDS[target], entry, entry.get("value"))
            if value is not None:
                arrays[target][index] = value
    return replace(figures, **arrays)


def _places() -> dict[str, tuple[str, tuple[int, ...]]]:
    """Return the array and the index of each parameter name."""
    places: dict[str, tuple[str, tuple[int, ...]]] = {}
    for i, a in enumerate("xyz"):
        places[f"bias_{a}"] = places[f"gyro_bias_{a}"] = ("gyro_bias", (i,))
        places[f"accel_bias_{a}"] = ("accel_bias", (i,))
        places[f"Ka2_{a}"] = ("second_order", (i,))
        for j, b in enumerate("xyz"):
            element = a if a == b else a + b
            places[f"Kg{element}"] = ("gyro_matrix", (i, j))
            places[f"Ka{element}"] = ("accel_matrix", (i, j))
            places[f"gsens_{a}{b}"] = ("g_sensitivity", (i, j))
    return places
