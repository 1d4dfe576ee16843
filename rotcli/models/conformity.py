"""Verdict on a measured value against limits with a guard band (JCGM 106:2012, 8.3)."""

import numpy as np

from rotcli.dataclass import dataclass

PASS, FAIL, UNDECIDED = "pass", "fail", "undecided"
DEFAULT_GUARD = 2.0  # sigma: one sided, 2.3 % of values beyond a limit


@dataclass(frozen=True)
class Limits:
    """Limits of one parameter in one unit; None where there is none. guard: in sigmas."""

    low: float | None
    high: float | None
    unit: str
    guard: float = DEFAULT_GUARD


def verdict(value: float, sigma: float | None, limits: Limits) -> str:
    """Return pass when inside by guard sigma, fail when outside by it, else undecided.

    A value without sigma is undecided. Check: guard 0 decides every value.

    >>> limits = Limits(-12.0, 12.0, "deg/h", guard=2.0)
    >>> verdict(10.0, 1.0, limits), verdict(11.0, 1.0, limits), verdict(14.1, 1.0, limits)
    ('pass', 'undecided', 'fail')
    """
    if sigma is None:
        return UNDECIDED
    low = -np.inf if limits.low is None else limits.low
    high = np.inf if limits.high is None else limits.high
    margin = limits.guard * sigma
    if low + margin <= value <= high - margin:
        return PASS
    if value < low - margin or value > high + margin:
        return FAIL
    return UNDECIDED
