"""A long-run SRINS calibration as a result document, tables, time series and report section."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rotcli import units
from rotcli.files.results.documents import quantity
from rotcli.files.results.groups import Source
from rotcli.files.tables import Column, Table
from rotcli.models import earth
from rotcli.srins.estimate import (
    Consistency,
    SrinsCalibration,
    uncalibrated_drift_error,
    uncalibrated_level_error,
    unreliable_estimates,
)
from rotcli.srins.filter import FilterSettings
from rotcli.srins.model import GYRO_BIAS_Z, STATES
from rotcli.srins.navigate import SrinsRun

Array = NDArray[np.float64]

KIND = "srins"
FRACTIONS = (0.33, 0.22, 0.10)  # of the stated drift: the paper's steps of convergence
_ARCSEC = units.UNITS["angle"]["arcsec"]
# Every state's human unit; positions are shown in metres.
_UNIT = {
    **dict.fromkeys(STATES, ("m/s", 1.0)),
    **dict.fromkeys(STATES[2:5], ("arcsec", _ARCSEC)),
    **dict.fromkeys(STATES[7:10], ("deg/h", units.DEG_PER_HOUR)),
    **dict.fromkeys(STATES[10:12], ("m/s^2", 1.0)),
}
_HISTORY = (*STATES[7:12], "phi_U", "phi_E", "phi_N")
_POINTS = 601  # of a history: a minute in ten hours


def _units(latitude: float) -> list[tuple[str, float]]:
    R_M, R_N = (float(r) for r in earth.radii(latitude))
    metres = {"d_latitude": 1.0 / R_M, "d_longitude": 1.0 / (R_N * float(np.cos(latitude)))}
    return [("m", metres[name]) if name in metres else _UNIT[name] for name in STATES]


def fields(
    result: SrinsCalibration,
    run: SrinsRun,
    started: float,
    settings: FilterSettings,
    error: Mapping[str, Array],
    *,
    drift: float,
    scale: float,
    installation: float,
    truth: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """Return the document's own fields.

    started: s, the filter's start on the log's clock; error: the INS error over the whole run;
    drift (rad/s), scale, installation (rad): what the user states of the sensors; truth: sensor
    errors by state's name in the document's units, where known.
    """
    latitude = float(run.solution.latitude[0])
    unit = _units(latitude)
    bias = uncalibrated_drift_error(latitude, scale, installation)
    level_bias = uncalibrated_level_error(latitude, scale, run.solution.theta)
    fractions = np.array(FRACTIONS)
    times = result.convergence(GYRO_BIAS_Z, drift * fractions)
    damping = settings.damping
    final = {
        name: quantity(result.estimates[-1, k] / f, result.sigma[-1, k] / f, u)
        for k, (name, (u, f)) in enumerate(zip(STATES, unit, strict=True))
    }
    return {
        "method": "srins",
        "mode": "damped" if damping.enabled else "undamped",
        "measured_damping_states": settings.measured_damping,
        "damping_radps": [damping.w1, damping.w2, damping.w3, damping.w4],
        "latitude_deg": latitude / units.DEG,
        "filter": {
            "start_s": started,
            "end_s": started + float(result.time[-1]),
            "interval_s": settings.interval,
        },
        "estimates": {name: final[name] for name in STATES[7:12]},
        "states": {name: final[name] for name in (*STATES[:7], *STATES[12:])},
        "truth": dict(truth) if truth else None,
        "expected_bias": {
            **quantity(bias / units.DEG_PER_HOUR, None, "deg/h"),
            "scale_ppm": scale / units.PPM,
            "installation_arcsec": installation / _ARCSEC,
        },
        "expected_bias_y": quantity(level_bias / units.DEG_PER_HOUR, None, "deg/h"),
        "unreliable": unreliable_estimates(result, settings.initial_sigma(latitude)),
        "convergence": {
            "stated_drift_dph": drift / units.DEG_PER_HOUR,
            "fractions": list(FRACTIONS),
            "hours": [None if t is None else t / units.HOUR for t in times],
        },
        "consistency": {
            "gnss": _consistency(result.gnss),
            "reference": None if result.reference is None else _consistency(result.reference),
        },
        "degrees": dict(zip(STATES, result.observability, strict=True)),
        "maneuvers_h": result.maneuvers / units.HOUR,
        "history": _history(result, unit),
        "ins_error": _thinned(error),
    }


def _consistency(found: Consistency) -> dict[str, Any]:
    low, high = found.bounds
    return {
        "nis_over_expected": found.ratio,
        "lower": low,
        "upper": high,
        "count": found.count,
        "sound": found.consistent,
    }


def _kept(count: int) -> NDArray[np.int64]:
    """Return the indices kept of a series, the last one among them."""
    return np.unique(np.linspace(0, count - 1, min(count, _POINTS)).round().astype(np.int64))


def _history(result: SrinsCalibration, unit: Sequence[tuple[str, float]]) -> dict[str, Any]:
    kept = _kept(len(result.time))
    history: dict[str, Any] = {"time_h": result.time[kept] / units.HOUR}
    for name in _HISTORY:
        k = STATES.index(name)
        history[name] = {
            "estimate": result.estimates[kept, k] / unit[k][1],
            "sigma": result.sigma[kept, k] / unit[k][1],
            "unit": unit[k][0],
        }
    return history


def _thinned(error: Mapping[str, Array]) -> dict[str, Any]:
    kept = _kept(len(next(iter(error.values()))))
    return {name: values[kept] for name, values in error.items()}


def ins_error(run: SrinsRun, differences: Array, epochs: NDArray[np.int64]) -> dict[str, Array]:
    """Return INS - GNSS over the whole run: hours, m/s, m; means over minutes, gaps left out."""
    per = max(1, round(60.0 / run.block))
    minutes = len(epochs) // per
    count = epochs[: minutes * per].reshape(minutes, per).sum(axis=1)
    sums = differences[:, : minutes * per].reshape(4, minutes, per).sum(axis=2)
    kept = count > 0
    mean = sums[:, kept] / count[kept]
    R_M, R_N = (float(r) for r in earth.radii(float(run.solution.latitude[0])))
    across = R_N * float(np.cos(run.solution.latitude[0]))
    middle = run.time[0] + run.block * per * (np.arange(minutes) + 0.5)
    return {
        "time_h": middle[kept] / units.HOUR,
        "v_east_mps": mean[0],
        "v_north_mps": mean[1],
        "north_m": mean[2] * R_M,
        "east_m": mean[3] * across,
    }


def series(result: SrinsCalibration, started: float, latitude: float) -> dict[str, Array]:
    """Return every state's estimate and sigma at each filter step, columns with their units."""
    columns: dict[str, Array] = {"time [s]": started + result.time}
    for k, (name, (u, f)) in enumerate(zip(STATES, _units(latitude), strict=True)):
        columns[f"{name} [{u}]"] = result.estimates[:, k] / f
        columns[f"sigma_{name} [{u}]"] = result.sigma[:, k] / f
    return columns


def table(doc: Mapping[str, Any]) -> Table:
    """Return the estimates of a document as a readable table."""
    truth = doc.get("truth") or {}
    unreliable = doc.get("unreliable") or {}
    rows = [
        (
            name,
            q["value"],
            q["sigma"],
            truth.get(name),
            doc["degrees"][name],
            q["unit"],
            f"no: {unreliable[name]}" if name in unreliable else "yes",
        )
        for name, q in doc["estimates"].items()
    ]
    hours = (doc["filter"]["end_s"] - doc["filter"]["start_s"]) / units.HOUR
    return Table(
        title=f"SRINS calibration, {doc['mode']}, {hours:.4g} h",
        columns=(
            Column("error"),
            Column("estimate", ".6f"),
            Column("sigma", ".6f"),
            Column("true", ".6f"),
            Column("degree", ".4f"),
            Column("unit"),
            Column("use"),
        ),
        rows=rows,
        note=" ".join(sentences(doc)),
    )


def sentences(doc: Mapping[str, Any]) -> list[str]:
    """Return the convergence, the expected errors and the consistency as sentences."""
    convergence = doc["convergence"]
    drift = convergence["stated_drift_dph"]
    reached = ", ".join(
        f"{fraction:.0%} " + ("not reached" if hours is None else f"after {hours:.2f} h")
        for fraction, hours in zip(convergence["fractions"], convergence["hours"], strict=True)
    )
    bias = doc["expected_bias"]
    gnss = doc["consistency"]["gnss"]
    verdict = "consistent" if gnss["sound"] else "not consistent"
    level = (doc.get("expected_bias_y") or {}).get("value") or 0.0
    also = f" and up to {level:.2e} deg/h in gyro_bias_y" if level else ""
    return [
        f"Sigma of gyro_bias_z against a drift of {drift:g} deg/h: {reached}.",
        f"Uncalibrated {bias['scale_ppm']:g} ppm and {bias['installation_arcsec']:g} arcsec cause "
        f"an error of up to {bias['value']:.2e} deg/h in gyro_bias_z "
        f"({bias['value'] / drift:.0%} of that drift){also}, which sigma does not contain.",
        f"GNSS innovations: {gnss['nis_over_expected']:.3f} of the expected mean square (95 % band "
        f"{gnss['lower']:.3f} to {gnss['upper']:.3f}): {verdict}.",
    ]


def _label(source: Source) -> str:
    states = "measured" if source.doc.get("measured_damping_states") else "estimated"
    return f"{source.path} ({source.doc['mode']}, damping states {states})"


def srins_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the report's tables: the estimates at the end, and the axial drift against time."""
    made = [_final(sources), *(_against_time(source) for source in sources)]
    return [*made, _claims()]


def _claims() -> Table:
    return Table(
        "SRINS: claims of the paper that this model does not support",
        (Column("claim"), Column("found here")),
        [
            ("the estimate of the drift needs the damping", "no: sigma is the same without it"),
            ("an early maneuver leaves a lasting offset", "no: it fades within hours"),
            ("a late maneuver speeds up convergence", "no: sigma of the axial drift is the same"),
            (
                "the estimates of the x and y drifts are modulated equivalents",
                "no: the constant drifts in the sensor frame are estimated",
            ),
        ],
        "Damping keeps the INS velocity errors small (see damped against undamped); gyro_bias_z "
        "is as well determined without it, within 0.1 % of sigma. The overshoot through a "
        "maneuver comes from a speed reference that does not follow it: it is tens of times "
        "larger in the level drifts than along the axis, fades, and is not there when the "
        "reference follows; measured damping states take most of it away.",
    )


def _final(sources: Sequence[Source]) -> Table:
    rows = []
    for source in sources:
        for name in STATES[7:10]:
            q = source.doc["estimates"][name]
            true = (source.doc.get("truth") or {}).get(name)
            rows.append((_label(source), name, q["value"], q["sigma"], true))
    return Table(
        "SRINS: gyro drifts at the end, deg/h",
        (
            Column("result"),
            Column("drift"),
            Column("estimate", ".6f"),
            Column("sigma", ".6f"),
            Column("true", ".6f"),
        ),
        rows,
        " ".join(sentences(sources[0].doc)[:2]),
    )


def _against_time(source: Source) -> Table:
    history = source.doc["history"]
    time = np.array(history["time_h"])
    names = STATES[7:12]
    rows = []
    for hour in range(1, int(time[-1] + 0.01) + 1):
        k = int(np.argmin(np.abs(time - hour)))
        cells = [history[name][key][k] for name in names for key in ("estimate", "sigma")]
        scale = [1e3, 1e3] * 3 + [1.0 / units.UNITS["acceleration"]["ug"]] * 4
        rows.append((float(time[k]), *(c * s for c, s in zip(cells, scale, strict=True))))
    columns = [Column("h", ".2f")]
    for name in names:
        columns += [Column(name, ".3f"), Column("sigma", ".3f")]
    return Table(
        f"SRINS: estimates against time, {_label(source)}",
        tuple(columns),
        rows,
        "Gyro drifts in 1e-3 deg/h, accelerometer biases in ug.",
    )
