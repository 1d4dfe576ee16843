"""Parameters of the full calibration: order, names, units, typical sizes, priors.

One vector contains all parameters in SI units and radians. Its order is the order of every result:
gyro matrix N (row by row), gyro biases, g-sensitivity G, gyro asymmetry, accelerometer matrix M,
biases, second-order terms, asymmetry, levers (row i: lever of accelerometer i), base tilt and
azimuth, table errors, clock offsets, gravity (offset from the nominal value), and three rotations
of each mounting after the first.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.units import DEG, DEG_PER_HOUR, PPM, STANDARD_GRAVITY, FloatArray

IntArray = NDArray[np.int64]

N, GYRO_BIAS, G, GYRO_ASYMMETRY = slice(0, 9), slice(9, 12), slice(12, 21), slice(21, 24)
M, ACCEL_BIAS, K2, ACCEL_ASYMMETRY = slice(24, 33), slice(33, 36), slice(36, 39), slice(39, 42)
LEVERS, BASE = slice(42, 51), slice(51, 54)
BASE_EAST, BASE_NORTH, BASE_AZIMUTH = 51, 52, 53
OUTER_MIDDLE, MIDDLE_INNER, MIDDLE_ZERO = 54, 55, 56
CLOCK_GYRO, CLOCK_ACCEL, GRAVITY = 57, 58, 59
FIXED_COUNT = 60  # parameters without the rotations of further mountings

ARCSEC = DEG / 3600.0
G_UNIT = DEG_PER_HOUR / STANDARD_GRAVITY  # deg/h/g in rad/s per m/s^2
K2_UNIT = 1e-6 / STANDARD_GRAVITY  # ug/g^2 in (m/s^2)/(m/s^2)^2
MILLIMETRE, MICROSECOND = 1e-3, 1e-6

DEFAULT_AZIMUTH_SIGMA = 0.05 * DEG  # rad; a table aligned with care by a theodolite or a gyro
DEFAULT_GRAVITY_SIGMA = 3e-4  # m/s^2: 30 mGal, normal gravity against the local value
PRIOR_FACTOR = 10.0  # prior sigma in typical sizes where nothing else is known
WEAK_FRACTION = 0.3  # a posterior sigma above this fraction of the typical size shows nothing


@dataclass(frozen=True)
class Group:
    """Parameters of one kind: names, unit of results, factor to SI, typical size (SI)."""

    names: tuple[str, ...]
    unit: str
    factor: float
    size: float
    words: str


def _matrix_names(prefix: str) -> tuple[str, ...]:
    """Return the nine names of a matrix, row by row: Kgx, Kgxy, Kgxz, Kgyx, ..."""
    return tuple(f"{prefix}{r}" if r == c else f"{prefix}{r}{c}" for r in "xyz" for c in "xyz")


def _pairs(prefix: str) -> tuple[str, ...]:
    return tuple(f"{prefix}{r}{c}" for r in "xyz" for c in "xyz")


def _axes(prefix: str) -> tuple[str, ...]:
    return tuple(f"{prefix}{axis}" for axis in "xyz")


_SCALE = 1e-3  # typical scale factor and installation error of a calibrated MEMS IMU
_ANGLE = 1e-3  # rad; typical table and mounting error
GROUPS: dict[str, Group] = {
    "N": Group(
        _matrix_names("Kg"), "ppm", PPM, _SCALE, "gyro scale factors and installation errors"
    ),
    "d": Group(_axes("bias_"), "deg/h", DEG_PER_HOUR, 100.0 * DEG_PER_HOUR, "gyro biases"),
    "G": Group(_pairs("gsens_"), "deg/h/g", G_UNIT, 10.0 * G_UNIT, "g-sensitivity of the gyros"),
    "Ag": Group(_axes("gyro_asymmetry_"), "ppm", PPM, 1e-4, "gyro asymmetry"),
    "M": Group(
        _matrix_names("Ka"), "ppm", PPM, _SCALE, "accelerometer scale factors and installation"
    ),
    "b": Group(_axes("accel_bias_"), "m/s^2", 1.0, 1e-2, "accelerometer biases"),
    "K2": Group(
        _axes("Ka2_"),
        "ug/g^2",
        K2_UNIT,
        1e-4 / STANDARD_GRAVITY,
        "accelerometer second-order terms",
    ),
    "Aa": Group(_axes("accel_asymmetry_"), "ppm", PPM, 1e-4, "accelerometer asymmetry"),
    "R": Group(
        tuple(f"lever_{i}_{c}" for i in "xyz" for c in "xyz"),
        "mm",
        MILLIMETRE,
        20.0 * MILLIMETRE,
        "levers of the accelerometers",
    ),
    "eps": Group(
        ("base_tilt_east", "base_tilt_north", "base_azimuth"),
        "arcsec",
        ARCSEC,
        _ANGLE,
        "attitude of the table's base",
    ),
    "table": Group(
        ("outer_middle", "middle_inner", "middle_zero"),
        "arcsec",
        ARCSEC,
        _ANGLE,
        "errors of the table's axes",
    ),
    "tau": Group(("clock_gyro", "clock_accel"), "us", MICROSECOND, 1e-3, "clock offsets"),
    "g": Group(("gravity",), "m/s^2", 1.0, DEFAULT_GRAVITY_SIGMA, "local gravity"),
}

NAMES: tuple[str, ...] = tuple(name for group in GROUPS.values() for name in group.names)
INDEX = {name: k for k, name in enumerate(NAMES)}


def names(mountings: int = 1) -> tuple[str, ...]:
    """Return the names of all parameters of a run with some mountings."""
    more = tuple(f"mounting_{m}_{axis}" for m in range(2, mountings + 1) for axis in "xyz")
    return NAMES + more


def count(mountings: int = 1) -> int:
    """Return the number of all parameters.

    >>> count(), count(3)
    (60, 66)
    """
    return FIXED_COUNT + 3 * (mountings - 1)


def _per_parameter(mountings: int, value: str) -> list[object]:
    one = [getattr(group, value) for group in GROUPS.values() for _ in group.names]
    angle = {"size": _ANGLE, "factor": ARCSEC, "unit": "arcsec"}[value]
    return one + [angle] * (3 * (mountings - 1))


def typical_sizes(mountings: int = 1) -> FloatArray:
    """Return the typical size of each parameter (p,), SI: the scale of all columns."""
    return np.array(_per_parameter(mountings, "size"), dtype=float)


def unit_factors(mountings: int = 1) -> FloatArray:
    """Return the factors (p,) from a result's unit to SI."""
    return np.array(_per_parameter(mountings, "factor"), dtype=float)


def unit_names(mountings: int = 1) -> list[str]:
    """Return the units of results."""
    return [str(unit) for unit in _per_parameter(mountings, "unit")]


def select(groups: str, axes: int, *, mountings: int = 1) -> IntArray:
    """Return the indices of the parameters of some groups that a table of `axes` axes has.

    groups: names of GROUPS with blanks between them. A table of one axis has no table errors, one
    of two axes has `outer_middle` alone. Rotations of further mountings always take part.

    >>> len(select("N d G M b K2 R eps table tau g", 3)), len(select("N d", 1, mountings=2))
    (54, 15)
    """
    chosen = [INDEX[name] for group in groups.split() for name in GROUPS[group].names]
    absent = {1: {OUTER_MIDDLE, MIDDLE_INNER, MIDDLE_ZERO}, 2: {MIDDLE_INNER, MIDDLE_ZERO}}
    chosen = [k for k in chosen if k not in absent.get(axes, set())]
    return np.array(sorted(chosen) + list(range(FIXED_COUNT, count(mountings))), dtype=np.int64)


BASIC = "N d G M b K2 R eps table tau g"
WITH_ASYMMETRY = "N d G Ag M b K2 Aa R eps table tau g"


def default_priors(mountings: int = 1) -> FloatArray:
    """Return prior sigmas (p,), SI: base azimuth and gravity; infinite for all others."""
    sigma = np.full(count(mountings), np.inf)
    sigma[BASE_AZIMUTH], sigma[GRAVITY] = DEFAULT_AZIMUTH_SIGMA, DEFAULT_GRAVITY_SIGMA
    return sigma


def weak_priors(mountings: int = 1) -> FloatArray:
    """Return `default_priors` with ten typical sizes in place of infinity."""
    return np.minimum(default_priors(mountings), PRIOR_FACTOR * typical_sizes(mountings))
