"""Expected RMS, median, 99.9 % quantile and p value of every reported error, and one verdict.

Eleven errors: the nine of a navigation and horizontal position and velocity. `p_run` judges a run:
at p < 1e-3 in any of eleven errors, 0.6 to 0.9 % of clean runs would warn. Seven times the
smallest p over the judged errors is exceeded at its nominal rate (2880 runs of 320 seeds:
p_run < 1e-3 in 0.03 and 0.2 %).
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.models.expected.distribution import QuadraticForms, quantiles, upper_tail
from rotcli.models.expected.errors import ExpectedErrors
from rotcli.models.expected.motion import ErrorName
from rotcli.units import DEG, FloatArray

HORIZONTAL_POSITION, HORIZONTAL_VELOCITY = 9, 10
VERTICAL = (ErrorName.HEIGHT, ErrorName.V_UP)

P_WARN = 1e-3  # of p_run: one clean run in a thousand
_INDEPENDENT_ERRORS = 7.0  # of the eleven: makes p_run uniform in its tail (measured)
# A vertical error with more of its mean square than this from second order is skewed: its 99.9 %
# limit is exceeded in 1.5 % of clean runs.
_MAX_SECOND_ORDER = 0.1
MAX_JUDGED_TILT = 30.0 * DEG  # of the nominal: beyond it the across-axis velocity is off by 1.7
# Random tilt (1 sigma, at the end): estimated; at 10 deg g (1 - cos) is 0.15 m/s^2 already.
MAX_RANDOM_TILT = 10.0 * DEG
# s; the height grows as exp(t sqrt(2 g/R)), 8 times there; verified up to this (40 seeds).
MAX_FREE_HEIGHT_TIME = 1200.5
MAX_VELOCITY = 500.0  # m/s; transport rate and Coriolis of the velocity are left out of F


@dataclass(frozen=True, eq=False)
class ExpectedStatistics:
    """Figures (11,) of the eleven errors: m, m/s, rad.

    reasons: why an error has no p value (or "" where it has one); valid: (11,) whether the linear
    propagation is valid; where it does not, `rms` must not be used.
    """

    rms: FloatArray
    median: FloatArray
    q999: FloatArray
    reasons: tuple[str, ...]
    valid: NDArray[np.bool_]
    forms: QuadraticForms

    def p_values(self, observed: FloatArray) -> FloatArray:
        """Return the chance (11,) of RMS at least as large as observed (11,); NaN: not judged."""
        p = upper_tail(self.forms, np.maximum(observed, 0.0) ** 2)
        return np.where([bool(reason) for reason in self.reasons], np.nan, p)


def run_p_value(p_values: FloatArray) -> float:
    """Return p_run, the chance that a clean run has a smallest p as small as this (NaN ignored).

    >>> run_p_value(np.array([0.5, 1e-4, np.nan])) == 7e-4
    True
    """
    judged = p_values[~np.isnan(p_values)]
    if not len(judged):
        return float("nan")
    return float(min(1.0, _INDEPENDENT_ERRORS * judged.min()))


def expected_statistics(expected: ExpectedErrors, *, incomplete: str = "") -> ExpectedStatistics:
    """Return the statistics of expected errors.

    incomplete: what is unknown, so that the figures are lower bounds; then nothing is judged.
    """
    forms = expected.random.axes.forms(expected.mean)
    limits = validity_limits(expected)
    reasons = [limit or (f"a lower bound: {incomplete}" if incomplete else "") for limit in limits]
    if expected.tilt > MAX_JUDGED_TILT:
        tilt = f"the axis column tilts the computed frame by {expected.tilt / DEG:.0f} deg"
        reasons = [r or tilt for r in reasons]
    square = expected.mean_square
    for k in VERTICAL:
        if expected.second_order[k] > _MAX_SECOND_ORDER * square[k]:
            share = expected.second_order[k] / square[k]
            reasons[k] = reasons[k] or (
                f"{100.0 * share:.0f} % of the mean square is of second order in the tilt: skewed"
            )
    median, q999 = np.sqrt(quantiles(forms, (0.5, 0.999))).T
    return ExpectedStatistics(
        rms=expected.rms,
        median=median,
        q999=q999,
        reasons=tuple(reasons),
        valid=np.array([not limit for limit in limits]),
        forms=forms,
    )


def validity_limits(expected: ExpectedErrors) -> list[str]:
    """Return for each of the eleven errors why the linear propagation does not hold, or ""."""
    deviation = np.sqrt(np.maximum(expected.variance[-1], 0.0))
    tilt = float(max(deviation[ErrorName.PITCH], deviation[ErrorName.ROLL]))
    fast = float(max(expected.envelope[-1, [ErrorName.V_NORTH, ErrorName.V_EAST]]))
    every = ""
    if tilt > MAX_RANDOM_TILT:
        every = f"the tilt error reaches {tilt / DEG:.0f} deg (1 sigma): not linear"
    elif fast > MAX_VELOCITY:
        every = f"the velocity error reaches {fast:.0f} m/s: not linear"
    limits = [every] * 11
    duration = float(expected.time[-1])
    for k in VERTICAL:
        if duration > MAX_FREE_HEIGHT_TIME and expected.variance[-1, k] > 0.0:
            limits[k] = limits[k] or f"free height over {duration:.0f} s: it grows exponentially"
    return limits
