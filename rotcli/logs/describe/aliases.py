"""Usual column names of IMU, table and reference logs.

A triad is found when three columns differ in their axis only (x, y, z; 0, 1, 2; 1, 2, 3) and the
rest of the name is one of the usual words. A name with a unit at its end (`gyro_x_dps`) has it.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from rotcli.logs.describe.words import ACCEL_WORDS, GYRO_WORDS
from rotcli.units import UNITS

# Words for readings that are not those of the sensor: a triad of them is never taken.
_DERIVED = re.compile(r"free|user|gravity|bias|cov|std|sigma|mag|ref|var|orient|quat|earth|sync")

_ENDINGS = {
    "dps": "deg/s",
    "deg_s": "deg/s",
    "degs": "deg/s",
    "deg_per_s": "deg/s",
    "degps": "deg/s",
    "deg_sec": "deg/s",
    "mdps": "mdeg/s",
    "rad_s": "rad/s",
    "rads": "rad/s",
    "radps": "rad/s",
    "rad_sec": "rad/s",
    "rad_per_s": "rad/s",
    "dph": "deg/h",
    "deg_h": "deg/h",
    "rpm": "rpm",
    "mps2": "m/s^2",
    "m_s2": "m/s^2",
    "ms2": "m/s^2",
    "mpss": "m/s^2",
    "m_s_2": "m/s^2",
    "m_per_s2": "m/s^2",
    "m_s_s": "m/s^2",
    "g": "g",
    "mg": "mg",
    "ug": "ug",
    "deg": "deg",
    "degrees": "deg",
    "rad": "rad",
    "arcsec": "arcsec",
    "mps": "m/s",
    "m_s": "m/s",
    "s": "s",
    "sec": "s",
    "ms": "ms",
    "us": "us",
    "usec": "us",
    "ns": "ns",
    "nsec": "ns",
    "min": "min",
    "degc": "degC",
    "deg_c": "degC",
    "celsius": "degC",
    "c": "degC",
    "degf": "degF",
    "k": "K",
    "kelvin": "K",
    "m": "m",
}


def plain_name(name: str) -> str:
    """Return a name in lower case with single underscores.

    >>> plain_name("Gyro X"), plain_name("angularVelocity.x"), plain_name("TimeUS")
    ('gyro_x', 'angular_velocity_x', 'time_us')
    """
    split = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name.strip())
    split = re.sub(r"(?<=[A-Z])(?=[A-Z][a-z])", "_", split)
    return re.sub(r"[^a-z0-9]+", "_", split.lower()).strip("_")


def unit_in_name(name: str, *kinds: str) -> tuple[str, str | None]:
    """Return a plain name without the unit at its end, and the unit where there is one.

    >>> unit_in_name("gyro_x_dps", "rate"), unit_in_name("accel_z", "acceleration")
    (('gyro_x', 'deg/s'), ('accel_z', None))
    """
    for ending in sorted(_ENDINGS, key=len, reverse=True):
        unit = _ENDINGS[ending]
        if name.endswith(f"_{ending}") and any(unit in UNITS[kind] for kind in kinds):
            return name[: -len(ending) - 1], unit
    return name, None


@dataclass(frozen=True)
class Triad:
    """Three columns x, y, z of one sensor: their indices, and the word they share."""

    columns: tuple[int, int, int]
    word: str
    unit: str | None = None


_MAX_NAMES = 1000  # columns that are compared with the usual names
_SHORT_WORD = 2  # letters; a longer word is recognised with words before it
_AXES = (("x", "y", "z"), ("0", "1", "2"), ("1", "2", "3"))
_KINDS = {"gyro": ("rate", "angle"), "accel": ("acceleration", "velocity")}


def find_triads(names: Sequence[str], sensor: str) -> list[Triad]:
    """Return the triads of a sensor (`gyro` or `accel`) among column names, the best first."""
    groups: dict[tuple[str, str], dict[str, int]] = {}
    about: dict[tuple[str, str], tuple[int, str | None]] = {}
    for k, raw in enumerate(names[:_MAX_NAMES]):
        plain = plain_name(raw)
        bare, unit = unit_in_name(plain, *_KINDS[sensor])
        for candidate, own in dict.fromkeys(((bare, unit), (plain, None))):
            for word, axis, shape in _splits(candidate):
                rank = _rank(word, sensor)
                if rank is not None:
                    groups.setdefault((word, shape), {}).setdefault(axis, k)
                    about.setdefault((word, shape), (rank, own))
    found = []
    for (word, shape), axes in groups.items():
        for letters in _AXES:
            if set(letters) == set(axes):
                x, y, z = (axes[letter] for letter in letters)
                rank, own = about[word, shape]
                found.append((rank, x, Triad((x, y, z), word, own)))
    unique: dict[tuple[int, int, int], Triad] = {}
    for _, _, triad in sorted(found, key=lambda item: item[:2]):
        unique.setdefault(triad.columns, triad)
    return list(unique.values())


def _rank(word: str, sensor: str) -> int | None:
    """Return how usual a word is for a sensor (0 first), None where it is none of its words.

    A number of an IMU and words before are allowed: `imu0_gyro`, `data_angular_velocity`.
    """
    words = GYRO_WORDS if sensor == "gyro" else ACCEL_WORDS
    if _DERIVED.search(word):
        return None
    bare = unit_in_name(word, *_KINDS[sensor])[0]
    for step, stem in enumerate((word, bare, re.sub(r"_?\d+(?=_|$)", "", word))):
        if stem in words:
            return words.index(stem) + step * len(words)
        for known in words:
            if len(known) > _SHORT_WORD and stem.endswith(f"_{known}"):
                return words.index(known) + (step + 3) * len(words)
    return None


def _splits(name: str) -> list[tuple[str, str, str]]:
    """Return the ways to split a plain name into word and axis."""
    found = []
    for pattern, shape in ((r"(.+?)_?([xyz0123])", "word first"), (r"([xyz])_(.+)", "axis first")):
        match = re.fullmatch(pattern, name)
        if match:
            word, axis = match.groups() if shape == "word first" else match.groups()[::-1]
            found.append((word.strip("_"), axis, shape))
    inner = re.fullmatch(r"(.+?)_([xyz])_(.+)", name)
    if inner:  # gyro_x_raw
        found.append((f"{inner[1]}_{inner[3]}", inner[2], "axis inside"))
    return found


def find_named(names: Sequence[str], known: Sequence[str], *kinds: str) -> int | None:
    """Return the index of the first column with a known name, None where there is none.

    A unit at the end of the name may be left out of the comparison.
    """
    plain = [plain_name(name) for name in names[:_MAX_NAMES]]
    bare = [unit_in_name(name, *kinds)[0] for name in plain]
    for wanted in known:
        for options in (plain, bare):
            if wanted in options:
                return options.index(wanted)
    return None
