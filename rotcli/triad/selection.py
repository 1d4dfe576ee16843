"""Weights and parameters of the estimate that the data decide: noise factors, unseen groups."""

from dataclasses import replace

import numpy as np

from rotcli.models.triad import parameters as p
from rotcli.models.triad.blocks import Blocks
from rotcli.models.triad.information import Problem
from rotcli.run.findings import Finding
from rotcli.triad.drift import Drift
from rotcli.triad.estimate import SCALE_SIGNIFICANCE, Fit, estimate
from rotcli.triad.result import NULL, Estimate, choose_convention, estimates_of
from rotcli.units import DEG

UNKNOWN_AZIMUTH = 30.0 * DEG  # rad, sigma of the prior; a smaller error needs no search
MAX_WEIGHTINGS = 3  # rounds of new weights; the second changes some per cent

# Terms that are small in most sensors; a motion that shows none of a group does without it.
_UNSEEN = 0.5  # of the prior sigma (ten typical sizes): a larger one is hardly narrowed by the data
_OPTIONAL_GROUPS = ("Ag", "Aa", "G", "K2")


def _is_unseen(estimate: Estimate, fit: Fit) -> bool:
    """Whether the data hardly narrow the prior of a parameter."""
    k = p.INDEX.get(estimate.name)
    if k is None or estimate.sigma is None:
        return False
    return estimate.sigma * float(p.unit_factors()[k]) > _UNSEEN * float(fit.problem.prior_sigma[k])


def without_unseen_groups(
    fit: Fit,
    factors: tuple[float, float],
    blocks: Blocks,
    drift: Drift | None,
    convention: str,
) -> tuple[Fit, tuple[float, float], list[Estimate]]:
    """Return the estimate without the optional groups of which the data show nothing.

    With them free the biases of a single vertical axis would be unknown as well. Their parameters
    are returned as null estimates: zero is assumed.
    """
    assumed: list[Estimate] = []
    for _ in _OPTIONAL_GROUPS:
        found, _ = estimates_of(fit, choose_convention(fit, convention))
        null = {e.name: e for e in found if e.status == NULL and _is_unseen(e, fit)}
        unseen = [
            name
            for group in _OPTIONAL_GROUPS
            for name in p.GROUPS[group].names
            if all(n in null for n in p.GROUPS[group].names)
        ]
        if not unseen:
            break
        assumed += [
            replace(null[name], reason=f"{null[name].reason}; zero is assumed") for name in unseen
        ]
        keep = np.array([p.names(1)[k] not in unseen if k < p.FIXED_COUNT else True
                         for k in fit.problem.free])  # fmt: skip
        problem = replace(
            fit.problem,
            free=fit.problem.free[keep],
            sigma_1=fit.problem.sigma_1 / np.repeat(factors, 3),
        )
        fit, factors = weighted_fit(problem, blocks, drift)
    return fit, factors, assumed


def assumed_zero(assumed: list[Estimate], path: str) -> Finding:
    """Return the note on groups that were assumed to be zero."""
    groups = [
        group.words
        for key, group in p.GROUPS.items()
        if key in _OPTIONAL_GROUPS and any(e.name in group.names for e in assumed)
    ]
    return Finding(
        "assumed-zero",
        f"{path}: the motion does not show {', '.join(groups)}. Zero is assumed, and the sigmas of "
        "the other parameters do not contain them; turn about more axes",
    )


def _first_fit(problem: Problem, blocks: Blocks, drift: Drift | None) -> Fit:
    """Return the estimate from errors of zero; from four azimuths of a base that has none.

    Earth rate is a sine of the azimuth: from the opposite direction Gauss-Newton does not find it.
    """
    sigma = float(problem.prior_sigma[p.BASE_AZIMUTH])
    if p.BASE_AZIMUTH not in problem.free or sigma <= UNKNOWN_AZIMUTH:
        return estimate(problem, blocks, drift=drift)
    fits = []
    for azimuth in (0.0, 90.0, 180.0, -90.0):
        start = np.zeros(len(problem.prior_sigma))
        start[p.BASE_AZIMUTH] = azimuth * DEG
        fits.append(estimate(problem, blocks, drift=drift, start=start))
    return min(fits, key=lambda fit: (not fit.converged, fit.chi2))


def weighted_fit(
    problem: Problem, blocks: Blocks, drift: Drift | None
) -> tuple[Fit, tuple[float, float]]:
    """Return the estimate whose noise agrees with the residuals of each triad, and the factors.

    Where the residuals of gyros or accelerometers are significantly larger than the noise, the
    noise of that triad is multiplied; so errors of one triad's model do not spoil the other's
    sigmas.
    """
    factors = np.ones(2)
    fit = _first_fit(problem, blocks, drift)
    for _ in range(MAX_WEIGHTINGS):
        rows = 3.0 * len(blocks)
        limit = 1.0 + SCALE_SIGNIFICANCE * np.sqrt(2.0 / rows)
        total = sum(k.blocks for k in fit.kinds)
        ratios = np.array(
            [
                sum(k.gyro * k.blocks for k in fit.kinds) / total,
                sum(k.accel * k.blocks for k in fit.kinds) / total,
            ]
        )
        if np.all(ratios < limit):
            break
        more = np.where(ratios < limit, 1.0, np.sqrt(ratios))
        factors = factors * more
        problem = replace(problem, sigma_1=problem.sigma_1 * np.repeat(more, 3))
        drift = drift.scaled(np.repeat(more, 3)) if drift else None
        again = estimate(problem, blocks, drift=drift, start=fit.x)
        fit = replace(again, rank=fit.rank, passes=fit.passes + again.passes)
    return fit, (float(factors[0]), float(factors[1]))
