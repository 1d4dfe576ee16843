"""Collect the contents of a certificate from the documents of one device."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from rotcli.certificate.contents import (
    Certificate,
    InputFile,
    NoiseRow,
    ParameterRow,
)
from rotcli.certificate.curves import Input, read_curves, real
from rotcli.certificate.lab_tests import laboratory_rows
from rotcli.certificate.numbers import quantity_text
from rotcli.errors import ResultError
from rotcli.files.results.identity import Identity, identity
from rotcli.files.spec import Spec
from rotcli.models.conformity import FAIL, PASS, UNDECIDED, Limits, verdict
from rotcli.models.noise_numbers import ACCEL_UNITS, GYRO_UNITS

KINDS = ("calibration", "allan", "warm-up")
SYMBOLS = {
    "quantization": "Q",
    "random_walk": "N",
    "bias_instability": "B",
    "rate_random_walk": "K",
    "rate_ramp": "R",
}
# Parameters of the table and the site, not of the device.
_SET_UP = ("base_", "outer_middle", "middle_", "gravity", "clock_", "lever_")
_AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
_DEFAULT_EQUATION = "w = (I + N)^-1 (gyro - d), f = accel - b"
# What a complete characterisation contains: name, parameters of which all must be there.
_COMPLETE = (
    ("gyro biases", ("bias_x", "bias_y", "bias_z")),
    ("gyro scale factors", ("Kgx", "Kgy", "Kgz")),
    ("gyro installation errors", ("Kgxy", "Kgxz", "Kgyx", "Kgyz", "Kgzx", "Kgzy")),
    ("g-sensitivity", ("gsens_xx", "gsens_yy", "gsens_zz")),
    ("accelerometer biases", ("accel_bias_x", "accel_bias_y", "accel_bias_z")),
    ("accelerometer scale factors", ("Kax", "Kay", "Kaz")),
    ("accelerometer installation errors", ("Kayx", "Kazx", "Kazy")),
    ("second-order accelerometer terms", ("Ka2_x", "Ka2_y", "Ka2_z")),
)


def certificate(
    inputs: Sequence[Input], spec: Spec | None = None, fleet: Mapping[str, Any] | None = None
) -> Certificate:
    """Return the certificate of the one device that the documents belong to.

    fleet: a document of kind `fleet` for repeatability and position. Raises ResultError for
    documents of several devices or of kinds that have no place in a certificate.
    """
    if not inputs:
        raise ResultError("no results; add the results of one device")
    ordered = sorted(inputs, key=lambda entry: (identity(entry.doc).date or "", entry.path))
    who = _one_device(ordered)
    try:
        return _build(ordered, who, spec, fleet)
    except (AttributeError, KeyError, TypeError, ValueError) as fault:
        names = ", ".join(entry.path for entry in ordered[:3])
        raise ResultError(
            f"{names}: not valid results ({type(fault).__name__}: {str(fault)[:80]}); "
            "create them again"
        ) from fault


def _build(
    inputs: Sequence[Input], who: Identity, spec: Spec | None, fleet: Mapping[str, Any] | None
) -> Certificate:
    calibrations = [entry for entry in inputs if entry.doc["kind"] == "calibration"]
    allans = [entry for entry in inputs if entry.doc["kind"] == "allan"]
    limits = {} if spec is None else spec.limits
    parameters = _parameters(calibrations, spec, _of_fleet(fleet, who))
    noise = _noise(allans[-1].doc, spec) if allans else ()
    tests = laboratory_rows([entry.doc for entry in inputs])
    named = {row.name for row in parameters if row.value is not None}
    named |= {f"{row.axis}.{key}" for row in noise for key, s in SYMBOLS.items() if s == row.symbol}
    untested = [f"{name} (limits of the specification)" for name in limits if name not in named]
    judged = [row.verdict for row in parameters] + [row.verdict for row in noise]
    verdicts = [word for word in judged if word is not None]
    return Certificate(
        identity=who,
        dates=tuple(dict.fromkeys(d[:10] for e in inputs if (d := identity(e.doc).date))),
        inputs=tuple(_input(entry) for entry in inputs),
        spec=None if spec is None else spec.path,
        parameters=parameters,
        noise=noise,
        tests=tests,
        equations=_equations(calibrations),
        not_tested=(*_not_tested(named, noise, calibrations), *untested),
        verdict=None if spec is None else _overall(verdicts, bool(untested)),
        curves=read_curves(allans, calibrations),
        notes=_notes(calibrations),
    )


def _one_device(inputs: Sequence[Input]) -> Identity:
    """Return the identity of the last document with what earlier ones add; one device only."""
    found = Identity()
    first: dict[str, str] = {}
    for entry in inputs:
        kind = entry.doc.get("kind")
        if kind not in KINDS:
            raise ResultError(
                f"{entry.path}: kind {kind} has no place in a certificate; "
                "use results of calibrate, triad, scale, thermal, allan"
            )
        this = identity(entry.doc)
        for label in ("serial", "name"):
            value = getattr(this, label)
            if value is None:
                continue
            if first.setdefault(label, value) != value:
                raise ResultError(
                    f"{entry.path}: {label} {value}, but another input has {first[label]}; "
                    "make one certificate per device"
                )
        changed = {k: v for k, v in vars(this).items() if v}
        found = replace(found, **changed)
    return found


def _input(entry: Input) -> InputFile:
    logs = tuple((str(log["path"]), str(log["sha256"])) for log in entry.doc.get("inputs", ()))
    kind = str(entry.doc.get("model") or entry.doc["kind"])
    return InputFile(entry.path, kind, identity(entry.doc).date, entry.sha256, logs)


def _of_fleet(fleet: Mapping[str, Any] | None, who: Identity) -> dict[str, dict[str, Any]]:
    """Return fleet and unit entries by parameter; raises ResultError for an unknown device."""
    if fleet is None:
        return {}
    found = {}
    for name, parameter in fleet["parameters"].items():
        unit = parameter["by_unit"].get(who.device)
        if unit is not None:
            found[name] = {"fleet": parameter, "unit": unit}
    if not found:
        raise ResultError(f"the fleet contains no results of {who.device}; use another fleet file")
    return found


def _parameters(
    calibrations: Sequence[Input], spec: Spec | None, fleet: Mapping[str, Mapping[str, Any]]
) -> tuple[ParameterRow, ...]:
    history: dict[str, list[Mapping[str, Any]]] = {}
    for entry in calibrations:
        for name, value in entry.doc["parameters"].items():
            if not name.startswith(_SET_UP):
                history.setdefault(name, []).append(value)
    rows = []
    for name, entries in history.items():
        known = [e for e in entries if e.get("value") is not None and e.get("status") != "prior"]
        if not known:
            reason = str(entries[-1].get("reason") or "not observable")
            rows.append(ParameterRow(name, None, None, str(entries[-1]["unit"]), 0, remark=reason))
            continue
        rows.append(_parameter(name, known, spec, fleet.get(name)))
    return tuple(rows)


def _parameter(
    name: str,
    known: Sequence[Mapping[str, Any]],
    spec: Spec | None,
    fleet: Mapping[str, Any] | None,
) -> ParameterRow:
    last, unit = known[-1], str(known[-1]["unit"])
    value, sigma = float(last["value"]), real(last.get("sigma"))
    limits = None if spec is None else spec.limits_in(name, unit)
    if spec is not None and name in spec.limits and limits is None:
        raise ResultError(
            f"{spec.path}: [limits] {name}: unit {spec.limits[name].unit}, but the result is in "
            f"{unit}; use that unit"
        )
    same = [float(e["value"]) for e in known if e["unit"] == unit]
    row = ParameterRow(
        name,
        value,
        sigma,
        unit,
        turn_ons=len(same),
        mean=sum(same) / len(same) if len(same) > 1 else None,
        limits=None if limits is None else limit_text(limits),
        verdict=None if limits is None else verdict(value, sigma, limits),
    )
    return row if fleet is None else _with_fleet(row, fleet)


def _with_fleet(row: ParameterRow, fleet: Mapping[str, Any]) -> ParameterRow:
    of_fleet, groups_of_device = fleet["fleet"]["repeatability"], fleet["unit"]

    def value(entry: Mapping[str, Any] | None) -> float | None:
        return None if entry is None else real(entry["value"])

    trend = groups_of_device.get("trend")
    return replace(
        row,
        turn_on_sigma=real(groups_of_device.get("turn_on")),
        fleet_turn_on=value(of_fleet["turn_on"]),
        fleet_day_to_day=value(of_fleet["day_to_day"]),
        percentile=real(groups_of_device.get("percentile")),
        trend=None
        if trend is None
        else quantity_text(trend) + (", significant" if trend["significant"] else ""),
    )


def limit_text(limits: Limits) -> str:
    """Return limits as `-120 to 120`, `below 5`, `above 1`."""
    if limits.low is None:
        return f"below {limits.high:.6g}"
    if limits.high is None:
        return f"above {limits.low:.6g}"
    return f"{limits.low:.6g} to {limits.high:.6g}"


def _noise(doc: Mapping[str, Any], spec: Spec | None) -> tuple[NoiseRow, ...]:
    rows = []
    for axis in _AXES:
        entry = doc["axes"].get(axis)
        for name in ("random_walk", "bias_instability", "rate_random_walk"):
            c = None if entry is None else entry["coefficients"].get(name)
            if c is None:
                continue
            si = c.get("si") or {}
            limits = None if spec is None else spec.limits_in(f"{axis}.{name}", c["unit"])
            rows.append(
                NoiseRow(
                    axis,
                    SYMBOLS[name],
                    real(c.get("value")),
                    real(c.get("upper")),
                    real(c.get("sigma")),
                    str(c["unit"]),
                    _in_si(c, si, axis, name),
                    str(si.get("unit", "")),
                    limits=None if limits is None else limit_text(limits),
                    verdict=None if limits is None else _noise_verdict(c, limits),
                )
            )
    return tuple(rows)


def _in_si(c: Mapping[str, Any], si: Mapping[str, Any], axis: str, name: str) -> float | None:
    """Return a coefficient in SI units, or its upper limit where it is not significant."""
    value, upper = real(si.get("value")), real(c.get("upper"))
    unit = (GYRO_UNITS if axis.startswith("gyro") else ACCEL_UNITS)[name]
    if value is not None or upper is None or c.get("unit") != unit.name:
        return value
    return upper * unit.size


def _noise_verdict(c: Mapping[str, Any], limits: Limits) -> str:
    """Return the verdict; a coefficient below its 95 % limit passes when that limit does."""
    if c.get("value") is not None:
        return verdict(float(c["value"]), c.get("sigma"), limits)
    upper = c.get("upper")
    inside = upper is not None and limits.high is not None and upper <= limits.high
    return PASS if inside and limits.low is None else UNDECIDED


def _overall(verdicts: Sequence[str], untested: bool) -> str:
    if FAIL in verdicts:
        return FAIL
    if untested or UNDECIDED in verdicts or not verdicts:
        return UNDECIDED
    return PASS


def _equations(calibrations: Sequence[Input]) -> tuple[str, ...]:
    texts = [str(e.doc.get("equation") or _DEFAULT_EQUATION) for e in calibrations]
    return tuple(dict.fromkeys(texts))


def _not_tested(
    named: set[str], noise: Sequence[NoiseRow], calibrations: Sequence[Input]
) -> list[str]:
    """Return the parts of a complete characterisation that the inputs lack, in part or in full."""
    missing = []
    for label, names in _COMPLETE:
        lacking = [name for name in names if name not in named]
        if len(lacking) == len(names):
            missing.append(label)
        elif lacking:
            missing.append(f"{label} {', '.join(lacking)}")
    axes = {row.axis for row in noise}
    for label, prefix in (("gyro noise", "gyro"), ("accelerometer noise", "accel")):
        if not any(axis.startswith(prefix) for axis in axes):
            missing.append(label)
    models = {e.doc.get("model") for e in calibrations}
    if "scale" not in models:
        missing.append("scale factor over rates")
    if "thermal" not in models:
        missing.append("temperature")
    return missing


def _notes(calibrations: Sequence[Input]) -> tuple[str, ...]:
    """Return notes on the sigmas: the horizon of the biases, and warnings of the results."""
    notes = []
    for entry in calibrations:
        horizon = entry.doc.get("horizon")
        if isinstance(horizon, Mapping) and "start_s" in horizon:
            notes.append(
                f"bias sigmas of {entry.path}: for the mean over {horizon['start_s']:.6g} to "
                f"{horizon['end_s']:.6g} s of its log"
            )
    count = sum(len(entry.doc.get("warnings") or ()) for entry in calibrations)
    if count:
        notes.append(f"warnings in the result files: {count}")
    return tuple(notes)
