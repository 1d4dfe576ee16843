"""Named unit conversions and angle wrapping; the only place where conversion factors stand."""

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

DEG = math.pi / 180.0  # rad
HOUR = 3600.0  # s
DEG_PER_HOUR = DEG / HOUR  # rad/s
DEG_PER_ROOT_HOUR = DEG / math.sqrt(HOUR)  # rad/sqrt(s), an angle random walk
METRE_PER_SECOND_PER_ROOT_HOUR = 1.0 / math.sqrt(HOUR)  # m/s/sqrt(s), a velocity random walk
PPM = 1e-6
STANDARD_GRAVITY = 9.80665  # m/s^2, CGPM 1901: the g of datasheets and of logs in g

# Factor to SI of every unit a log may name, by the kind of quantity.
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "angle": {"rad": 1.0, "deg": DEG, "arcmin": DEG / 60.0, "arcsec": DEG / 3600.0},
    "rate": {"rad/s": 1.0, "deg/s": DEG, "deg/h": DEG_PER_HOUR, "rpm": 2.0 * math.pi / 60.0},
    "acceleration": {
        "m/s^2": 1.0,
        "g": STANDARD_GRAVITY,
        "mg": STANDARD_GRAVITY * 1e-3,
        "ug": STANDARD_GRAVITY * 1e-6,
    },
    "length": {"m": 1.0},
    "velocity": {"m/s": 1.0},
    "temperature": {"degC": 1.0, "K": 1.0, "degF": 5.0 / 9.0},
}
# Temperature in degC of the zero of each unit.
TEMPERATURE_ZERO = {"degC": 0.0, "K": -273.15, "degF": -32.0 * 5.0 / 9.0}

# Other spellings found in real logs (EuRoC writes `rad s^-1`).
SPELLINGS = {
    "rad s^-1": "rad/s",
    "deg s^-1": "deg/s",
    "m s^-2": "m/s^2",
    "m/s2": "m/s^2",
    "m/s²": "m/s^2",
    "m s^-1": "m/s",
    "°": "deg",
    "°/s": "deg/s",
    "°/h": "deg/h",
    "°C": "degC",
    "°F": "degF",
    "C": "degC",
    "F": "degF",
}

_Angle = TypeVar("_Angle", float, NDArray[np.float64])


def factor(unit: str, *kinds: str) -> float | None:
    """Return the factor from `unit` to SI, or None when none of the kinds knows the unit.

    >>> factor("deg/h", "rate") == DEG / 3600
    True
    >>> factor("deg/h", "time", "angle") is None
    True
    """
    name = SPELLINGS.get(unit.strip(), unit.strip())
    for kind in kinds:
        if name in UNITS[kind]:
            return UNITS[kind][name]
    return None


def wrap_pi(angle: _Angle) -> _Angle:
    """Wrap an angle (rad) into [-pi, pi).

    >>> round(wrap_pi(3.5 * math.pi) / math.pi, 12)
    -0.5
    """
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def show_time(time: float) -> str:
    """Return a time (s) as messages show it: six digits, and hundredths of any later clock.

    >>> show_time(38.5), show_time(1234.5678), show_time(1700000123.456)
    ('38.5', '1234.57', '1700000123.46')
    """
    if not 1e4 <= abs(time) < 1e13:
        return f"{time:.6g}"
    return f"{time:.2f}".rstrip("0").rstrip(".")


def show_span(start: float, end: float) -> str:
    """Return a stretch of a log (s) as messages show it.

    >>> show_span(60.0, 120.5)
    '60 to 120.5 s'
    """
    return f"{show_time(start)} to {show_time(end)} s"


def digits(value: float, count: int = 3) -> str:
    """Return a number to some significant digits, never with an exponent below a million.

    >>> digits(2995.549), digits(0.04567), digits(12.0)
    ('3000', '0.0457', '12')
    """
    return f"{float(f'{value:.{count}g}'):.12g}"
