"""Tables of scale factor tests, from their documents."""

from collections.abc import Mapping, Sequence
from typing import Any

from rotcli.files.results.groups import Source, device_label
from rotcli.files.tables import Cell, Column, Table
from rotcli.scale.document import axis_text
from rotcli.units import digits

_FIGURES = (
    Column("figure"),
    Column("value", ".2f"),
    Column("sigma", ".2f"),
    Column("unit"),
    Column("remark"),
)


def tables(doc: Mapping[str, Any], label: str = "") -> list[Table]:
    """Return summary, gyros and residuals of one document; label: of the IMU."""
    title = f"Scale factor over rates about {axis_text(doc)}{label and ', ' + label}"
    return [_summary(doc, title), _gyros(doc, title), _residuals(doc, title)]


def scale_tables(sources: Sequence[Source]) -> list[Table]:
    """Return the tables of several documents, for a report."""
    found = []
    for source in sources:
        found += tables(source.doc, device_label(source.imu, "z"))
    return found


def _row(name: str, q: Mapping[str, Any] | None, remark: str = "") -> tuple[Cell, ...]:
    if q is None:
        return (name, None, None, "", remark or "not tested")
    return (name, q["value"], q["sigma"], q["unit"], remark)


def _summary(doc: Mapping[str, Any], title: str) -> Table:
    """Return the figures of the gyro along the axis."""
    main = doc["channels"][doc["main"]]
    horizon = doc["horizon"]
    window = f"mean of {horizon['start_s']:g} to {horizon['end_s']:g} s"
    rows = [
        _row("scale factor error", main["scale"]),
        _row("offset", main["offset"], window),
        _row("offset", main["offset_own_span"], "mean of the test"),
        _row("asymmetry", main["asymmetry"]),
        _nonlinearity(main),
        _row("composite error", main["composite"], "largest, noise included"),
        _hysteresis(main["hysteresis"]),
        _misalignment(doc["misalignment"]),
        *_response(main["response_ratio"]),
        *_repeatability(doc["repeatability"]),
    ]
    scale = doc["full_scale"]
    note = f"Full scale: {scale['value']:g} deg/s ({scale['source']}). {_verdict(doc['verdict'])}"
    return Table(title, _FIGURES, rows, note)


def _nonlinearity(main: Mapping[str, Any]) -> tuple[Cell, ...]:
    NL = main["nonlinearity"]
    if main["linear"]:
        remark = f"p = {main['p_line']:.2g}; raw maximum {NL['raw']:.0f}"
        return ("nonlinearity below", NL["raw_limit_95"], None, NL["unit"], remark)
    remark = f"{main['model']}, at {NL['rate_dps']:.4g} deg/s, p = {main['p_line']:.2g}"
    return ("nonlinearity", NL["value"], NL["sigma"], NL["unit"], remark)


def _hysteresis(h: Mapping[str, Any] | None) -> tuple[Cell, ...]:
    if h is None:
        return _row("hysteresis", None)
    limit = h["limit"]
    remark = "significant" if limit is None else f"below {limit:.1f} deg/h"
    return _row("hysteresis, up minus down", h, remark)


def _misalignment(alpha: Mapping[str, Any]) -> tuple[Cell, ...]:
    remark = "with table axis, mounting"
    if alpha["limit"] is not None:
        remark = f"below {alpha['limit']:.0f} urad; {remark}"
    return _row("misalignment", alpha, remark)


def _response(ratio: Mapping[str, Any] | None) -> list[tuple[Cell, ...]]:
    if ratio is None:
        return []
    smallest = f"below {ratio['smallest_rate_dps']:.3g} deg/s"
    band = ratio["dead_band_dps"]
    threshold = ratio["threshold_dps"]
    reached = "" if threshold is not None else "no response shown at any rate"
    return [
        ("dead band", band, None, "deg/s", "" if band is not None else smallest),
        ("threshold at most", threshold, None, "deg/s", reached),
    ]


def _repeatability(r: Mapping[str, Any] | None) -> list[tuple[Cell, ...]]:
    if r is None:
        return []
    remark = f"{r['logs']} turn-ons; 95 %: {r['low_95']:.1f} to {r['high_95']:.1f}"
    return [("scale repeatability", r["value"], None, "ppm", remark)]


def _verdict(v: Mapping[str, Any]) -> str:
    """Return the verdict on one linear calibration."""
    if v["deviation"]["value"] == 0.0:
        return "One linear calibration is good enough: no nonlinearity is significant."
    size = f"{v['deviation']['value']:.1f} deg/h at {v['rate_dps']:.4g} deg/s"
    against = f"the sigma of a run of {v['run_s']:g} s is {v['sigma_dph']:.1f} deg/h"
    if v["any_run"]:
        return f"One linear calibration is good enough for every run: it leaves {size}; {against}."
    if v["up_to_s"] is None:
        return f"One linear calibration is not good enough: it leaves {size}; {against}."
    return (
        f"One linear calibration is good enough for runs up to {digits(v['up_to_s'], 2)} s: "
        f"it leaves {size}; {against}."
    )


def _gyros(doc: Mapping[str, Any], title: str) -> Table:
    columns = (
        Column("gyro"),
        Column("model"),
        Column("K (ppm)", ".1f"),
        Column("sigma", ".1f"),
        Column("bias (deg/h)", ".2f"),
        Column("sigma", ".2f"),
        Column("chi2", ".1f"),
        Column("dof", "d"),
    )
    rows: list[tuple[Cell, ...]] = []
    for name, channel in doc["channels"].items():
        K, offset, test = channel["scale"], channel["offset"], doc["goodness"][name]
        rows.append(
            (
                name,
                channel["model"],
                K["value"],
                K["sigma"],
                offset["value"],
                offset["sigma"],
                test["chi2"],
                test["dof"],
            )
        )
    note = (
        "K: mean slope of the error curve e, reading over rate about the axis: scale factor error "
        "of the gyro along the axis, installation error of the others; bias: d. "
        f"{doc.get('equation', '')}."
    )
    return Table(f"{title}: gyros", columns, rows, note)


def _residuals(doc: Mapping[str, Any], title: str) -> Table:
    columns = (
        Column("rate (deg/s)", ".5g"),
        Column("residual (deg/h)", ".2f"),
        Column("sigma", ".2f"),
        Column("curve (deg/h)", ".2f"),
        Column("ppm of full scale", ".1f"),
        Column("ppm of rate", ".1f"),
    )
    keys = (
        "rate_dps",
        "residual_dph",
        "sigma_dph",
        "curve_dph",
        "ppm_full_scale",
        "ppm_rate",
    )
    main = doc["channels"][doc["main"]]
    rows = [tuple(row[key] for key in keys) for row in main["residuals"]]
    note = "Mean error at each rate minus the straight line; curve: selected model minus the line."
    return Table(f"{title}: residuals of gyro {doc['main']}", columns, rows, note)
