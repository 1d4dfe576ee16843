"""Fit the noise terms where the curve follows them, and say where it does not."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from rotcli.allan.fit.coefficients import MIN_CLUSTERS, NoiseFit, fit_noise, without_coefficients
from rotcli.allan.fit.goodness import Goodness
from rotcli.allan.fit.summary import Summary
from rotcli.dataclass import dataclass

# p-value of curve against model that one axis in ten thousand has by chance.
MIN_P_VALUE = 1e-4
_NEIGHBOURS = 1.6  # ratio of cluster times that are excluded together: they share their samples
_MIN_SHARE = 0.5  # of the cluster times that must remain
# A misfit that remains makes the coefficients wrong by about as much; beyond this they are null.
MAX_DEVIATION = 0.1


@dataclass(frozen=True)
class Misfit:
    """The comparison with all cluster times, and the cluster times (s) that were excluded."""

    goodness: Goodness
    excluded: tuple[float, ...]


def fit_trimmed(
    record: Summary, sampling: str, markov_time: float | None = None
) -> tuple[NoiseFit, Misfit | None]:
    """Fit a record; where the terms do not describe it, exclude the cluster times that deviate.

    The cluster times around the largest deviation are excluded until the p-value is MIN_P_VALUE,
    half of them at most. If none of these fits agrees, the fit to all cluster times remains, with
    null coefficients where the curve deviates by more than MAX_DEVIATION.
    """
    fit = fit_noise(record, sampling, markov_time)
    first = fit.goodness
    if first is None or first.p_value >= MIN_P_VALUE:
        return fit, None
    kept = np.ones(len(record.factors), dtype=bool)
    trial = fit
    while trial.goodness is not None and trial.goodness.p_value < MIN_P_VALUE:
        tau = record.factors * record.interval
        ratio = tau / trial.goodness.largest_tau
        kept &= (ratio > _NEIGHBOURS) | (ratio < 1.0 / _NEIGHBOURS)
        if kept.sum() < max(_MIN_SHARE * len(kept), MIN_CLUSTERS):
            break
        trial = fit_noise(_part(record, kept), sampling, markov_time)
    if trial.goodness is not None and trial.goodness.p_value >= MIN_P_VALUE:
        excluded = tuple(float(t) for t in (record.factors * record.interval)[~kept])
        return trial, Misfit(first, excluded)
    if abs(first.largest) > MAX_DEVIATION:
        reason = (
            f"the curve deviates from all noise terms by {100.0 * first.largest:.2g} % at "
            f"{first.largest_tau:.3g} s"
        )
        fit = without_coefficients(fit, reason)
    return fit, Misfit(first, ())


def _part(record: Summary, kept: NDArray[np.bool_]) -> Summary:
    return replace(
        record,
        factors=record.factors[kept],
        variance=record.variance[kept],
        bend=record.bend[kept],
        white_share=record.white_share[kept],
    )
