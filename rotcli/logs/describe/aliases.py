"""Usual column names of IMU, table and reference logs.

A triad is found when three columns differ in their axis only (x, y, z; 0, 1, 2; 1, 2, 3) and the
rest of the name is one of the usual words. A name with a unit at its end (`gyro_x_dps`) has it.
"""

import re
from collections.abc import Iterator, Sequence
from functools import lru_cache

from rotcli.dataclass import dataclass
from rotcli.logs.describe.words import ACCEL_WORDS, GYRO_TRIPLES, GYRO_WORDS, STATES
from rotcli.units import UNITS

# Words for readings that are not those of the sensor: a triad of them is never taken.
_DERIVED = re.compile(
    r"free|user|gravity|bias|cov|std|sigma|mag|ref|var|orient|quat|earth|sync|setpoint|desired|target"
    r"|command|cmd"
)

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

_ANY_ENDING = tuple(f"_{ending}" for ending in sorted(_ENDINGS, key=len, reverse=True))


def plain_name(name: str) -> str:
    """Return a name in lower case with single underscores.

    >>> plain_name("Gyro X"), plain_name("angularVelocity.x"), plain_name("TimeUS")
    ('gyro_x', 'angular_velocity_x', 'time_us')
    >>> plain_name("ω_x"), plain_name("gyro(X)")
    ('omega_x', 'gyro_x')
    """
    name = name.strip().replace("ω", "omega").replace("Ω", "omega").replace("θ", "theta")
    split = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    split = re.sub(r"(?<=[A-Z])(?=[A-Z][a-z])", "_", split)
    return re.sub(r"[^a-z0-9]+", "_", split.lower()).strip("_")


def unit_in_name(name: str, *kinds: str) -> tuple[str, str | None]:
    """Return a plain name without the unit at its end, and the unit where there is one.

    >>> unit_in_name("gyro_x_dps", "rate"), unit_in_name("accel_z", "acceleration")
    (('gyro_x', 'deg/s'), ('accel_z', None))
    """
    if name.endswith(_ANY_ENDING):
        for ending in _ANY_ENDING:
            unit = _ENDINGS[ending[1:]]
            if name.endswith(ending) and any(unit in UNITS[kind] for kind in kinds):
                return name[: -len(ending)], unit
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
    for k, word, axis, shape, rank, own in _axes_of(names, sensor):
        groups.setdefault((word, shape), {}).setdefault(axis, k)
        about.setdefault((word, shape), (rank, own))
    found = []
    for (word, shape), axes in groups.items():
        for letters in _AXES:
            others = set(axes) - set(letters)
            if set(letters) <= set(axes) and not (others and letters[0] != "x"):
                x, y, z = (axes[letter] for letter in letters)
                rank, own = about[word, shape]
                found.append((rank, x, Triad((x, y, z), word, own)))
    unique: dict[tuple[int, int, int], Triad] = {}
    for _, _, triad in sorted(found, key=lambda item: item[:2]):
        unique.setdefault(triad.columns, triad)
    if not unique and sensor == "gyro":
        return _named_triples(names)
    return list(unique.values())


def find_triads_by_unit(
    names: Sequence[str], units: Sequence[str | None], sensor: str
) -> list[Triad]:
    """Return the triad of columns that have the name of an axis only, and a unit of the sensor.

    Such as `X Axis (g)`, `x [deg/s]`.
    """
    found: dict[str, int] = {}
    for k, (name, unit) in enumerate(zip(names[:_MAX_NAMES], units, strict=False)):
        match = re.fullmatch(r"([xyz])(?:_axis)?|axis_([xyz])", plain_name(name))
        if match and any(unit in UNITS[kind] for kind in _KINDS[sensor]):
            axis = match[1] or match[2]
            if axis in found:
                return []
            found[axis] = k
    return [Triad((found["x"], found["y"], found["z"]), "axis")] if len(found) == 3 else []


def single_axes(names: Sequence[str], sensor: str) -> dict[str, int]:
    """Return the column of each axis (x, y, z) of a sensor of which a log has one or two axes."""
    found: dict[str, int] = {}
    for k, _, axis, _, _, _ in _axes_of(names, sensor):
        if axis in "xyz":
            found.setdefault(axis, k)
    return found if len(found) < 3 else {}


def mixed_axes(names: Sequence[str], sensor: str) -> dict[str, int]:
    """Return the column of each axis of a sensor whose three columns have different words.

    Such as `Gyr_X`, `GyroY`, `wz`. Empty where an axis has no column or several.
    """
    found: dict[str, set[int]] = {}
    for k, _, axis, _, _, _ in _axes_of(names, sensor):
        if axis in "xyz":
            found.setdefault(axis, set()).add(k)
    if len(found) < 3 or any(len(columns) > 1 for columns in found.values()):
        return {}
    return {axis: min(columns) for axis, columns in sorted(found.items())}


def _axes_of(
    names: Sequence[str], sensor: str
) -> Iterator[tuple[int, str, str, str, int, str | None]]:
    """Yield column, word, axis, shape of the name, rank and unit of columns of a sensor."""
    for k, raw in enumerate(names[:_MAX_NAMES]):
        plain = plain_name(raw)
        bare, unit = unit_in_name(plain, *_KINDS[sensor])
        for candidate, own in dict.fromkeys(((bare, unit), (plain, None))):
            for word, axis, shape in _splits(candidate):
                rank = _rank(word, sensor)
                if rank is not None:
                    yield k, word, axis, shape, rank, own


def _named_triples(names: Sequence[str]) -> list[Triad]:
    """Return the triad of gyros whose columns have names of their own: p, q, r."""
    plain = [plain_name(name) for name in names[:_MAX_NAMES]]
    bare = [unit_in_name(name, *_KINDS["gyro"]) for name in plain]
    for triple in GYRO_TRIPLES:
        for options in (plain, [name for name, _ in bare]):
            if all(options.count(name) == 1 for name in triple):
                x, y, z = (options.index(name) for name in triple)
                return [Triad((x, y, z), triple[0], bare[x][1])]
    return []


@lru_cache(maxsize=1024)
def _rank(word: str, sensor: str) -> int | None:
    """Return how usual a word is for a sensor (0 first), None where it is none of its words.

    A number of an IMU, words before and the state of the readings after are allowed: `imu0_gyro`,
    `data_angular_velocity`, `gyro_raw`.
    """
    words = GYRO_WORDS if sensor == "gyro" else ACCEL_WORDS
    if _DERIVED.search(word):
        return None
    bare = unit_in_name(word, *_KINDS[sensor])[0]
    for step, stem in enumerate((word, bare, re.sub(r"_?\d+(?=_|$)", "", word), _stateless(word))):
        if stem in words:
            return words.index(stem) + step * len(words)
        if not stem.endswith(words):
            continue
        for known in words:
            if len(known) > _SHORT_WORD and stem.endswith(f"_{known}"):
                return words.index(known) + (step + 4) * len(words)
    return None


def _stateless(word: str) -> str:
    """Return a word without the states of readings before and after it."""
    parts = word.split("_")
    for size in (2, 1):
        while len(parts) > size and "_".join(parts[-size:]) in STATES:
            parts = parts[:-size]
        while len(parts) > size and "_".join(parts[:size]) in STATES:
            parts = parts[size:]
    return "_".join(parts)


def _splits(name: str) -> list[tuple[str, str, str]]:
    """Return the possible splits of a plain name into word and axis."""
    found = []
    for pattern, shape in (
        (r"(.+?)_?([xyz0123])", "word first"),
        (r"([xyz])_(.+)", "axis first"),
        (r"(.+?)_?([xyz])_?out", "output"),
    ):
        match = re.fullmatch(pattern, name)
        if match:
            word, axis = match.groups() if shape != "axis first" else match.groups()[::-1]
            found.append((word.strip("_"), axis, shape))
    if name[:1] in ("x", "y", "z") and _stateless(name[1:]) in (*GYRO_WORDS, *ACCEL_WORDS):
        found.append((name[1:], name[0], "axis first"))  # xgyro
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
