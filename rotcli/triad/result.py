"""Result of a full calibration: parameters in a convention, what is null and why, findings."""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.triad import parameters as p
from rotcli.models.triad.conventions import convert, convert_covariance
from rotcli.run.findings import Finding
from rotcli.triad.estimate import Fit, KindGoodness
from rotcli.triad.words import describe_null, reason_of_null
from rotcli.units import FloatArray

WHITE_NOISE, ALL_NOISE = "white noise", "white and slow noise of the rig"  # noise models
ESTIMATED, PRIOR, NULL = "estimated", "prior", "null"
_BY_CONVENTION = "zero by convention"
_PRIOR_SHARE = 0.9  # of its prior sigma: data that narrow it by less than a tenth show nothing


@dataclass(frozen=True)
class Estimate:
    """One parameter: value and sigma in its unit; value None with the reason where null."""

    name: str
    value: float | None
    sigma: float | None
    unit: str
    status: str
    reason: str = ""


@dataclass(frozen=True, eq=False)
class TriadResult:
    """A full calibration.

    method: "table" or "hand-held"; estimates in the order of the covariance (of those with a
    value), whose units are theirs. null_directions: as `describe_null`; series: block or pose
    time (s) with readings' residuals before and after, for plots. span: start and end (s) of the
    data, whose mean biases the biases are; None of merged calibrations.
    """

    method: str
    convention: str
    estimates: tuple[Estimate, ...]
    covariance: FloatArray
    null_directions: list[dict[str, object]]
    rank: int | None
    chi2: float
    dof: int
    scale: float
    noise_model: str
    kinds: tuple[KindGoodness, ...]
    findings: tuple[Finding, ...]
    details: dict[str, object]
    series: dict[str, FloatArray]
    span: tuple[float, float] | None = None

    @property
    def known(self) -> list[Estimate]:
        """The parameters that have a value."""
        return [e for e in self.estimates if e.value is not None]


def choose_convention(fit: Fit, wanted: str) -> str:
    """Return the convention; `auto`: that in which the data show more elements of the matrices.

    The accelerometer convention wins where a common rotation of all sensor axes is not known, as
    with mountings by hand; the table convention in all other cases.
    """
    if wanted != "auto":
        return wanted
    shown = {name: _elements_shown(fit, name) for name in ("table", "accelerometer")}
    return "accelerometer" if shown["accelerometer"] > shown["table"] else "table"


def _elements_shown(fit: Fit, convention: str) -> int:
    """Return the number of elements of N, G, M and levers that have a value of their own."""
    found, _ = estimates_of(fit, convention)
    names = {n for group in ("N", "G", "M", "R") for n in p.GROUPS[group].names}
    return sum(
        e.name in names and e.status == ESTIMATED and e.reason != _BY_CONVENTION for e in found
    )


def estimates_of(fit: Fit, convention: str) -> tuple[tuple[Estimate, ...], FloatArray]:
    """Return all free parameters in a convention, and the covariance of those with a value."""
    mountings = fit.problem.table.mounting_count
    converted = convert(fit.x, convention)
    covariance = convert_covariance(fit.covariance, fit.problem.free, converted.derivative)
    fixed = _fixed_by_convention(convention)
    covariance[list(fixed), :] = covariance[:, list(fixed)] = 0.0
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    size, factor = p.typical_sizes(mountings), p.unit_factors(mountings)
    unit, names = p.unit_names(mountings), p.names(mountings)
    found, known = [], []
    for k in fit.problem.free:
        prior = p.default_priors(mountings)[k]
        value, status, reason = converted.x[k], ESTIMATED, ""
        if k == p.GRAVITY:
            value = value + fit.problem.table.gravity
        if k in fixed:
            value, status, reason = 0.0, ESTIMATED, _BY_CONVENTION
        elif np.isfinite(prior):
            own = fit.problem.prior_sigma[k]
            if sigma[k] > _PRIOR_SHARE * own:
                status, reason = PRIOR, "known from its prior alone"
        elif sigma[k] > p.WEAK_FRACTION * size[k]:
            status = NULL
            reason = reason_of_null(names[k], sigma[k], size[k], unit[k], factor[k])
        shown = None if status == NULL else float(value / factor[k]) + 0.0
        spread = 0.0 if k in fixed else float(sigma[k] / factor[k])
        found.append(Estimate(names[k], shown, spread, unit[k], status, reason))
        if shown is not None:
            known.append(int(k))
    scaled = covariance[np.ix_(known, known)] / np.outer(factor[known], factor[known])
    return tuple(found), scaled


def _fixed_by_convention(convention: str) -> set[int]:
    """Return the entries of M that a convention makes zero."""
    upper, lower = {1, 2, 5}, {3, 6, 7}
    entries = {"accelerometer": upper, "z-accelerometer": lower}.get(convention, set())
    return {p.M.start + k for k in entries}


def null_directions(fit: Fit) -> list[dict[str, object]]:
    """Return the null directions of the data in words."""
    return describe_null(fit.rank, fit.problem.free, fit.problem.table.mounting_count)
