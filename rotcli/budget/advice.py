"""What an error budget recommends, computed from its numbers."""

import numpy as np

from rotcli.budget.estimate import STILL, Budget
from rotcli.units import DEG

_NOTHING = 1e-6  # m
_EQUAL = 1.01  # schemes whose position errors differ by less do equally well


def recommendation(result: Budget) -> str:
    """Return the axis with the smallest horizontal position error, and what it costs."""
    total = {axis: seen.position for axis, seen in result.totals.items()}
    horizontal = {axis: float(np.hypot(p[0], p[1])) for axis, p in total.items()}
    turning = {axis: h for axis, h in horizontal.items() if axis != STILL}
    least = min(turning.values())
    best = [axis for axis, h in turning.items() if h <= least * _EQUAL]
    if max(horizontal.values()) < _NOTHING:
        return "None of these sensor errors makes a horizontal position error: no axis is better."
    others = [f"{axis}: {h:.3g} m" for axis, h in turning.items() if axis not in best]
    others.append(f"no rotation: {horizontal[STILL]:.3g} m")
    azimuth = result.totals[best[0]].attitude[2] / DEG
    useless = least >= horizontal[STILL]
    end = " No rotation is better: there is little bias to modulate." if useless else ""
    return (
        f"Recommended axis: {' or '.join(best)} at {result.rate / DEG:.6g} deg/s. Horizontal "
        f"position error after {result.duration:g} s: {least:.3g} m ({', '.join(others)}). "
        f"Height error {abs(total[best[0]][2]):.3g} m, azimuth error {abs(azimuth):.3g} deg.{end}"
    )
