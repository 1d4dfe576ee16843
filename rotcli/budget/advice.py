"""What an error budget recommends, in one sentence computed from its numbers."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rotcli.budget.estimate import STILL, Budget
from rotcli.units import DEG

Array = NDArray[np.float64]

_NOTHING = 1e-6  # m
_EQUAL = 1.01  # schemes whose position errors differ by less do equally well


def recommendation(result: Budget) -> str:
    """Return the axis with the smallest horizontal position error, and what it costs."""
    total = _totals(result)
    horizontal = {axis: float(np.hypot(p[0], p[1])) for axis, p in total.items()}
    turning = {axis: h for axis, h in horizontal.items() if axis != STILL}
    least = min(turning.values())
    best = [axis for axis, h in turning.items() if h <= least * _EQUAL]
    if max(horizontal.values()) < _NOTHING:
        return "None of these sensor errors makes a horizontal position error: no axis is better."
    others = [f"{h:.3g} m about {axis}" for axis, h in turning.items() if axis not in best]
    others.append(f"{horizontal[STILL]:.3g} m standing still")
    azimuth = sum(g.navigated.attitude[2] for g in result.growth if g.axis == best[0]) / DEG
    useless = least >= horizontal[STILL]
    end = "; with so little bias to modulate, not turning is better still." if useless else "."
    return (
        f"Turn about {' or '.join(best)} at {result.rate / DEG:.6g} deg/s: "
        f"after {result.duration:g} s these sensor errors make "
        f"{least:.3g} m of horizontal position error, against {_listed(others)}; "
        f"what stays is {abs(total[best[0]][2]):.3g} m of height "
        f"and {abs(azimuth):.3g} deg of azimuth{end}"
    )


def _totals(result: Budget) -> dict[str, Array]:
    """Return the position error (3,) of all sources together, per scheme."""
    total: dict[str, Array] = {}
    for g in result.growth:
        total[g.axis] = total.get(g.axis, np.zeros(3)) + g.navigated.position
    return total


def _listed(texts: Sequence[str]) -> str:
    return texts[0] if len(texts) == 1 else ", ".join(texts[:-1]) + " and " + texts[-1]
