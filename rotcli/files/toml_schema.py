"""What profiles and scenarios ask of their TOML tables: known keys, sound numbers.

Every fault is one RigError line, `FILE: place: what is wrong`. The rig's own keys have limits and
units beside them (`rig_keys`).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli.errors import RigError
from rotcli.files.names import nearest

Array = NDArray[np.float64]


def check_keys(path: str, place: str, table: Any, known: tuple[str, ...]) -> None:
    """Raise RigError unless `table` is a table whose keys are all known."""
    if not isinstance(table, dict):
        raise RigError(f"{path}: {place}must be a table of keys")
    for key in table:
        if key not in known:
            advice = f"did you mean {nearest(key, known)}?"
            raise RigError(f"{path}: {place}{key}: unknown key; {advice}")


def check_number(path: str, key: str, value: Any, *, positive: bool = False) -> float:
    """Return the value as a float; raise RigError unless it is a finite number (not negative)."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise RigError(f"{path}: {key}: {value!r} is not a number")
    if positive and value < 0.0:
        raise RigError(f"{path}: {key}: {value!r} must not be negative")
    return float(value)


def check_three(path: str, key: str, value: Any) -> Array:
    """Return a list of three numbers as an array (3,); raise RigError for anything else."""
    if not isinstance(value, list) or len(value) != 3:
        raise RigError(f"{path}: {key}: must be a list of three numbers, x y z")
    return np.array([check_number(path, key, item) for item in value])


def check_seed(path: str, value: Any) -> int:
    """Return the seed of random numbers; raise RigError unless it is a whole number from 0."""
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise RigError(f"{path}: seed: {value!r} is not a whole number from 0")
    return value
