"""Numbers as a certificate shows them: with the digits that their sigma supports."""

import math
from collections.abc import Mapping
from typing import Any

DASH = "–"


def digits_of(value: float, sigma: float | None) -> str:
    """Return a value with the digits that its sigma supports (two of the sigma).

    >>> digits_of(62.8571, 14.23), digits_of(0.001234567, 0.00001), digits_of(12.5, None)
    ('63', '0.001235', '12.5')
    >>> digits_of(-0.2, 14.0)
    '0'
    """
    if sigma is None or not sigma > 0.0 or not math.isfinite(sigma):
        return f"{value:.6g}"
    places = 1 - math.floor(math.log10(sigma))
    if places > 9:
        return f"{value:.6g}"
    return f"{round(value, max(places, 0)) + 0.0:.{max(places, 0)}f}"  # + 0.0: no minus zero


def quantity_text(entry: Mapping[str, Any]) -> str:
    """Return a quantity with its sigma: `12.3 ± 0.4 ppm`."""
    value, sigma = entry.get("value"), entry.get("sigma")
    if value is None:
        return "not estimated"
    spread = "" if sigma is None else f" ± {digits_of(sigma, sigma)}"
    return f"{digits_of(value, sigma)}{spread} {short_unit(str(entry['unit']))}"


def short_unit(unit: str) -> str:
    """Return a unit as it fits into a cell: FS is full scale."""
    return unit.replace("ppm of full scale", "ppm FS")


def number(value: float | None, pattern: str = ".3g") -> str:
    """Return a number, or a dash for None and NaN."""
    return DASH if value is None or math.isnan(value) else format(value, pattern)
