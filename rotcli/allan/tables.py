"""Noise figures of a document as readable tables."""

from collections.abc import Mapping
from typing import Any

from rotcli import units
from rotcli.files.tables import Cell, Column, Table

_LABELS = {
    "quantization": "Q quantization",
    "random_walk": "N random walk",
    "bias_instability": "B bias instability",
    "rate_random_walk": "K rate random walk",
    "rate_ramp": "R rate ramp",
}


def noise_table(doc: Mapping[str, Any]) -> Table:
    """Return the figures of an allan document as a readable table, one block an axis."""
    rows: list[tuple[Cell, ...]] = []
    for axis, noise in doc["axes"].items():
        for name, c in noise["coefficients"].items():
            rows.append((axis, _LABELS[name], c["value"], c["sigma"], c["unit"], _note(c)))
        rows += [_minimum(axis, noise), _markov(axis, noise)]
    window = doc["window"]
    number = Column("", ".4g").format
    return Table(
        title=f"Noise from {units.format_span(window['start_s'], window['end_s'])} ({_used(doc)})",
        columns=(
            Column("axis"),
            Column("figure"),
            Column("value", number),
            Column("sigma", ".2g"),
            Column("unit"),
            Column("note"),
        ),
        rows=rows,
        note="A dash: not significant in this record; <: its 95 % upper limit.",
    )


def _note(coefficient: Mapping[str, Any]) -> str:
    """Return the upper limit of a coefficient, or the reason why it has none."""
    if coefficient["value"] is not None:
        return ""
    if coefficient["upper"] is not None:
        return f"< {coefficient['upper']:.3g}"
    return str(coefficient["reason"] or "")


def _minimum(axis: str, noise: Mapping[str, Any]) -> tuple[Cell, ...]:
    lowest = noise["minimum"]
    if lowest["tau_s"] is None:
        return (axis, "minimum", None, None, lowest["unit"], lowest["reason"])
    half = 0.5 * (lowest["upper"] - lowest["lower"])
    at = f"at {lowest['tau_s']:.4g} s"
    return (axis, "minimum", lowest["deviation"], half, lowest["unit"], at)


def _markov(axis: str, noise: Mapping[str, Any]) -> tuple[Cell, ...]:
    markov = noise["gauss_markov"]
    sigma = markov["sigma"] or {"value": None, "sigma": None, "unit": noise["unit"]}
    time = markov["correlation_time_s"]
    if time is None:
        note = markov["reason"]
    else:
        low, high = markov["correlation_time_limits_s"]
        note = f"correlation time {time:.4g} s ({low:.3g} to {high:.3g})"
    return (axis, "Gauss-Markov", sigma["value"], sigma["sigma"], sigma["unit"], note)


def _used(doc: Mapping[str, Any]) -> str:
    """Return how much of the log the figures rest on: samples, seconds, percent, segments."""
    text = f"{doc['samples']} samples"
    used = doc.get("used")
    if used is None:  # a document of an earlier version
        return text
    text += f", {used['seconds']:.6g} s, {used['percent']:.4g} % of the log"
    count = len(used["segments_s"])
    return f"{text}, {count} segments" if count > 1 else text


def curve_table(doc: Mapping[str, Any]) -> Table:
    """Return the deviations of an allan document, about four cluster times a decade."""
    axes = doc["axes"]
    taus = next(iter(axes.values()))["tau_s"]
    chosen: list[int] = []
    last = 0.0
    for k, tau in enumerate(taus):
        if not chosen or tau >= 1.7 * last or k == len(taus) - 1:
            chosen.append(k)
            last = tau
    columns = [Column(f"{name} [{axis['unit']}]", ".4g") for name, axis in axes.items()]
    return Table(
        title=f"Allan deviation ({doc['estimator']})",
        columns=(Column("tau [s]", ".6g"), *columns),
        rows=[(taus[k], *(axis["deviation"][k] for axis in axes.values())) for k in chosen],
    )


def goodness_table(doc: Mapping[str, Any]) -> Table | None:
    """Return how well curve and fitted terms agree, by axis; None where no axis was compared."""
    rows: list[tuple[Cell, ...]] = []
    for axis, noise in doc["axes"].items():
        good = noise.get("goodness")
        if good is None:
            continue
        tau = good["used_tau_s"]
        rows.append(
            (
                axis,
                good["chi2"] / good["dof"],
                good["dof"],
                good["p_value"],
                good["largest_percent"],
                good["largest_tau_s"],
                f"{tau[0]:.3g} to {tau[-1]:.3g} s",
            )
        )
    if not rows:
        return None
    return Table(
        "Goodness of fit",
        (
            Column("axis"),
            Column("chi2/dof", ".3g"),
            Column("dof", "d"),
            Column("p-value", ".2g"),
            Column("largest deviation, %", "+.2g"),
            Column("at tau, s", ".3g"),
            Column("fitted cluster times"),
        ),
        rows,
        "chi2: of curve and fitted terms with the covariance of the curve. A p-value below 1e-4 "
        "means that the terms do not describe the log.",
    )
