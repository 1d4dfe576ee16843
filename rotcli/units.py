"""Named unit conversions and angle wrapping; the only place with conversion factors."""

import math
import re
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
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0, "d": 86400.0},
    "angle": {
        "rad": 1.0,
        "deg": DEG,
        "mrad": 1e-3,
        "mdeg": DEG * 1e-3,
        "arcmin": DEG / 60.0,
        "arcsec": DEG / 3600.0,
        "gon": math.pi / 200.0,
        "rev": 2.0 * math.pi,
    },
    "rate": {
        "rad/s": 1.0,
        "deg/s": DEG,
        "deg/h": DEG_PER_HOUR,
        "rpm": 2.0 * math.pi / 60.0,
        "mdeg/s": DEG * 1e-3,
        "mrad/s": 1e-3,
        "rev/s": 2.0 * math.pi,
    },
    "acceleration": {
        "m/s^2": 1.0,
        "g": STANDARD_GRAVITY,
        "mg": STANDARD_GRAVITY * 1e-3,
        "ug": STANDARD_GRAVITY * 1e-6,
        "cm/s^2": 1e-2,
        "mm/s^2": 1e-3,
        "ft/s^2": 0.3048,
    },
    "length": {"m": 1.0, "km": 1e3, "ft": 0.3048},
    "velocity": {"m/s": 1.0, "km/h": 1.0 / 3.6, "cm/s": 1e-2, "mm/s": 1e-3, "kn": 1852.0 / 3600.0},
    # Temperatures are kept in degC; `TEMPERATURE_ZERO` is the zero of the others.
    "temperature": {"degC": 1.0, "K": 1.0, "degF": 5.0 / 9.0},
}
# Temperature in degC of the zero of each unit.
TEMPERATURE_ZERO = {"degC": 0.0, "K": -273.15, "degF": -32.0 * 5.0 / 9.0}

# Other spellings found in real logs (EuRoC writes `rad s^-1`, ST `mdps`, MicroStrain `rad/sec`).
# Blanks around a sign and upper case are ignored where no other unit has the same letters.
SPELLINGS = {
    "rad s^-1": "rad/s",
    "deg s^-1": "deg/s",
    "rad/sec": "rad/s",
    "radps": "rad/s",
    "radians/s": "rad/s",
    "rads": "rad/s",
    "rps": "rad/s",
    "radians/second": "rad/s",
    "rad.s-1": "rad/s",
    "rad s-1": "rad/s",
    "rad*s^-1": "rad/s",
    "deg/sec": "deg/s",
    "degrees/s": "deg/s",
    "degrees/second": "deg/s",
    "degree/s": "deg/s",
    "deg/second": "deg/s",
    "deg.s-1": "deg/s",
    "deg s-1": "deg/s",
    "deg*s^-1": "deg/s",
    "dps": "deg/s",
    "degps": "deg/s",
    "mdps": "mdeg/s",
    "mdeg/sec": "mdeg/s",
    "mrad/sec": "mrad/s",
    "deg/hr": "deg/h",
    "deg/hour": "deg/h",
    "dph": "deg/h",
    "rev/min": "rpm",
    "r/min": "rpm",
    "°": "deg",
    "degree": "deg",
    "degrees": "deg",
    "degs": "deg",
    "radian": "rad",
    "radians": "rad",
    "'": "arcmin",
    '"': "arcsec",
    "as": "arcsec",
    "turn": "rev",
    "gons": "gon",
    "grad": "gon",
    "grads": "gon",
    "turns": "rev",
    "°/s": "deg/s",
    "°/sec": "deg/s",
    "º/s": "deg/s",
    "°/h": "deg/h",
    "m s^-2": "m/s^2",
    "m s-2": "m/s^2",
    "m.s-2": "m/s^2",
    "m.s^-2": "m/s^2",
    "m*s^-2": "m/s^2",
    "m/s2": "m/s^2",
    "m/s²": "m/s^2",
    "m/s/s": "m/s^2",
    "m/s**2": "m/s^2",
    "m/sec^2": "m/s^2",
    "m/sec2": "m/s^2",
    "m/sec/sec": "m/s^2",
    "mps2": "m/s^2",
    "mpss": "m/s^2",
    "ms-2": "m/s^2",
    "ms^-2": "m/s^2",
    "ms2": "m/s^2",
    "m_s2": "m/s^2",
    "m/(s^2)": "m/s^2",
    "cm/s2": "cm/s^2",
    "gal": "cm/s^2",
    "mm/s2": "mm/s^2",
    "ft/s2": "ft/s^2",
    "ft/s/s": "ft/s^2",
    "µg": "ug",
    "μg": "ug",
    "gs": "g",
    "g's": "g",
    "g0": "g",
    "gn": "g",
    "milli-g": "mg",
    "millig": "mg",
    "m s^-1": "m/s",
    "m/sec": "m/s",
    "m.s-1": "m/s",
    "mps": "m/s",
    "knots": "kn",
    "kt": "kn",
    "sec": "s",
    "secs": "s",
    "second": "s",
    "seconds": "s",
    "msec": "ms",
    "msecs": "ms",
    "millisecond": "ms",
    "milliseconds": "ms",
    "millis": "ms",
    "usec": "us",
    "usecs": "us",
    "µs": "us",
    "μs": "us",
    "microsecond": "us",
    "microseconds": "us",
    "micros": "us",
    "nsec": "ns",
    "nsecs": "ns",
    "nanosecond": "ns",
    "nanoseconds": "ns",
    "nanos": "ns",
    "minutes": "min",
    "minute": "min",
    "hour": "h",
    "hours": "h",
    "hr": "h",
    "day": "d",
    "days": "d",
    "°c": "degC",
    "ºc": "degC",
    "deg_c": "degC",
    "deg c": "degC",
    "celsius": "degC",
    "degrees c": "degC",
    "c": "degC",
    "degree_celsius": "degC",
    "°f": "degF",
    "deg_f": "degF",
    "fahrenheit": "degF",
    "f": "degF",
    "kelvin": "K",
    "meters": "m",
    "metres": "m",
    "feet": "ft",
}
_LOWER = {
    **{unit.lower(): unit for kind in UNITS.values() for unit in kind},
    **SPELLINGS,
}

_Angle = TypeVar("_Angle", float, NDArray[np.float64])


def unit_name(text: str, *kinds: str) -> str | None:
    """Return the name of a unit that a text spells, or None when none of the kinds knows it.

    Without kinds any unit is found.

    >>> unit_name("dps"), unit_name("M/S^2"), unit_name("x8005")
    ('deg/s', 'm/s^2', None)
    """
    plain = re.sub(r"\s*([/*^])\s*", r"\1", " ".join(text.split()))
    for name in (plain, SPELLINGS.get(plain), _LOWER.get(plain.lower())):
        if name and any(name in UNITS[kind] for kind in kinds or UNITS):
            return name
    return None


def factor(unit: str, *kinds: str) -> float | None:
    """Return the factor from `unit` to SI, or None when none of the kinds knows the unit.

    >>> factor("deg/h", "rate") == DEG / 3600
    True
    >>> factor("deg/h", "time", "angle") is None
    True
    """
    name = unit_name(unit, *kinds)
    for kind in kinds:
        if name in UNITS[kind]:
            return UNITS[kind][name]
    return None


def wrap_pi(angle: _Angle) -> _Angle:
    """Wrap an angle (rad) into [-pi, pi).

    >>> round(float(wrap_pi(3.5 * math.pi)) / math.pi, 12)
    -0.5
    """
    # An angle inside does not change: a remainder would lose its last digits.
    turns = np.floor((angle + math.pi) / (2.0 * math.pi))
    wrapped: _Angle = angle - 2.0 * math.pi * turns
    return wrapped


def show_time(time: float) -> str:
    """Return a time (s) as messages show it: six digits, and hundredths of any later clock.

    >>> show_time(38.5), show_time(1234.5678), show_time(1700000123.456)
    ('38.5', '1234.57', '1700000123.46')
    """
    if not 1e4 <= abs(time) < 1e13:
        return f"{time:.6g}"
    return f"{time:.2f}".rstrip("0").rstrip(".")


def format_span(start: float, end: float) -> str:
    """Return a time interval of a log (s) as messages show it.

    >>> format_span(60.0, 120.5)
    '60 to 120.5 s'
    """
    return f"{show_time(start)} to {show_time(end)} s"


def digits(value: float, count: int = 3) -> str:
    """Return a number to some significant digits, never with an exponent below a million.

    >>> digits(2995.549), digits(0.04567), digits(12.0)
    ('3000', '0.0457', '12')
    """
    return f"{float(f'{value:.{count}g}'):.12g}"
