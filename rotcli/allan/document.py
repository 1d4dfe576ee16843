"""Noise figures as a result document, as tables, and as figures of a rig's [imu] table.

Every coefficient is given in the unit of datasheets with the SI one beside it.
"""

import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rotcli import units
from rotcli.allan.estimate import AllanResult, AxisNoise
from rotcli.allan.goodness import Goodness
from rotcli.allan.noise_fit import Coefficient
from rotcli.errors import RigError
from rotcli.files.atomic import atomic_write
from rotcli.files.results.documents import quantity
from rotcli.files.tables import Column, Table
from rotcli.files.text import read_text
from rotcli.rig.rig import rig_from_dict

KIND = "allan"

_UG = units.UNITS["acceleration"]["ug"]
# Coefficient: datasheet unit, its size in SI, SI unit.
_GYRO = {
    "quantization": ("arcsec", units.DEG / 3600.0, "rad"),
    "random_walk": ("deg/sqrt(h)", units.DEG_PER_ROOT_HOUR, "rad/s/sqrt(Hz)"),
    "bias_instability": ("deg/h", units.DEG_PER_HOUR, "rad/s"),
    "rate_random_walk": ("deg/h/sqrt(s)", units.DEG_PER_HOUR, "rad/s/sqrt(s)"),
    "rate_ramp": ("deg/h^2", units.DEG_PER_HOUR / units.HOUR, "rad/s^2"),
}
_ACCEL = {
    "quantization": ("m/s", 1.0, "m/s"),
    "random_walk": ("m/s/sqrt(h)", units.METRE_PER_SECOND_PER_ROOT_HOUR, "m/s^2/sqrt(Hz)"),
    "bias_instability": ("ug", _UG, "m/s^2"),
    "rate_random_walk": ("ug/sqrt(s)", _UG, "m/s^2/sqrt(s)"),
    "rate_ramp": ("ug/h", _UG / units.HOUR, "m/s^3"),
}
_LABELS = {
    "quantization": "Q quantization",
    "random_walk": "N random walk",
    "bias_instability": "B bias instability",
    "rate_random_walk": "K rate random walk",
    "rate_ramp": "R rate ramp",
}


def coefficient_units(axis: str) -> dict[str, tuple[str, float, str]]:
    """Return datasheet unit, its size in SI and the SI unit of each coefficient of an axis."""
    return _GYRO if axis.startswith("gyro") else _ACCEL


def deviation_unit(axis: str) -> tuple[str, float]:
    """Return the unit of an axis's deviation and its size in SI: deg/h or ug."""
    name, size, _ = coefficient_units(axis)["bias_instability"]
    return name, size


def fields(result: AllanResult) -> dict[str, Any]:
    """Return the document's own fields."""
    return {
        "estimator": result.estimator,
        "window": {"start_s": result.start, "end_s": result.end},
        "samples": result.samples,
        "interval_s": result.interval,
        "axes": {name: _axis(axis) for name, axis in result.axes.items()},
        "findings": [finding.to_dict() for finding in result.findings],
        "warnings": result.warnings,
    }


def _axis(axis: AxisNoise) -> dict[str, Any]:
    unit, size = deviation_unit(axis.name)
    lowest, markov, fit = axis.minimum, axis.gauss_markov, axis.fit
    ramp_unit, ramp, _ = coefficient_units(axis.name)["rate_ramp"]

    def scaled(value: float | None) -> float | None:
        return None if value is None else value / size

    return {
        "unit": unit,
        "tau_s": axis.tau,
        "deviation": axis.deviation / size,
        "lower": axis.lower / size,
        "upper": axis.upper / size,
        "degrees_of_freedom": axis.freedom,
        "coefficients": {
            name: _coefficient(axis.name, name, value) for name, value in fit.coefficients.items()
        },
        "minimum": {
            "tau_s": lowest.tau,
            "deviation": scaled(lowest.deviation),
            "lower": scaled(lowest.lower),
            "upper": scaled(lowest.upper),
            "unit": unit,
            "reason": lowest.reason,
        },
        "gauss_markov": {
            "sigma": None
            if markov.sigma is None or markov.sigma_spread is None
            else quantity(markov.sigma / size, markov.sigma * markov.sigma_spread / size, unit),
            "correlation_time_s": markov.time,
            "correlation_time_limits_s": None
            if markov.time is None or markov.time_spread is None
            else [markov.time * math.exp(k * markov.time_spread) for k in (-1, 1)],
            "reason": markov.reason,
        },
        "mean": quantity(axis.mean / size, None, unit),
        "trend": quantity(fit.trend / ramp, fit.trend_sigma / ramp, ramp_unit),
        "goodness": _goodness(fit.goodness),
        "spectrum": _spectrum(axis),
    }


def _goodness(goodness: Goodness | None) -> dict[str, Any] | None:
    if goodness is None:
        return None
    return {
        "chi2": goodness.chi2,
        "dof": goodness.dof,
        "p_value": goodness.p_value,
        "largest_percent": 100.0 * goodness.largest,
        "largest_sigma": goodness.largest_sigma,
        "largest_tau_s": goodness.largest_tau,
        "used_tau_s": list(goodness.tau),
    }


def _spectrum(axis: AxisNoise) -> dict[str, Any] | None:
    found = axis.spectrum
    if found is None:
        return None
    unit = "deg/s" if axis.name.startswith("gyro") else "m/s^2"
    scale = units.DEG if unit == "deg/s" else 1.0
    return {
        "cutoff_hz": found.cutoff,
        "repeats": found.repeats,
        "lines": [
            {"frequency_hz": line.frequency, "amplitude": line.amplitude / scale, "unit": unit}
            for line in found.lines
        ],
    }


def _coefficient(axis: str, name: str, found: Coefficient) -> dict[str, Any]:
    unit, size, si = coefficient_units(axis)[name]

    def scaled(value: float | None, by: float) -> float | None:
        return None if value is None else value / by

    return {
        "value": scaled(found.value, size),
        "sigma": scaled(found.sigma, size),
        "unit": unit,
        "upper": scaled(found.upper, size),
        "reason": found.reason,
        "si": {"value": found.value, "sigma": found.sigma, "unit": si},
    }


def table(doc: Mapping[str, Any]) -> Table:
    """Return the figures of an allan document as a readable table, one block an axis."""
    rows: list[tuple[str | float | None, ...]] = []
    for axis, noise in doc["axes"].items():
        for name, c in noise["coefficients"].items():
            bound = "" if c["upper"] is None else f"below {c['upper']:.3g} {c['unit']} (95 %)"
            note = "; ".join(part for part in (bound, c["reason"]) if part)
            value, si = [c["value"], c["sigma"], c["unit"]], c["si"]
            rows.append((axis, _LABELS[name], *value, si["value"], si["unit"], note))
        lowest, markov = noise["minimum"], noise["gauss_markov"]
        at = "" if lowest["tau_s"] is None else f"at {lowest['tau_s']:.4g} s"
        half = None if at == "" else 0.5 * (lowest["upper"] - lowest["lower"])
        note = lowest["reason"] or at
        rows.append((axis, "minimum", lowest["deviation"], half, lowest["unit"], None, "", note))
        sigma = markov["sigma"] or {"value": None, "sigma": None, "unit": noise["unit"]}
        time = markov["correlation_time_s"]
        if time is None:
            note = markov["reason"]
        else:
            low, high = markov["correlation_time_limits_s"]
            note = f"correlation time {time:.4g} s ({low:.3g} to {high:.3g})"
        value = [sigma["value"], sigma["sigma"], sigma["unit"]]
        rows.append((axis, "Gauss-Markov sigma", *value, None, "", note))
    window = doc["window"]
    number = Column("", ".4g").format
    return Table(
        title=f"Noise from {units.show_span(window['start_s'], window['end_s'])} "
        f"({doc['samples']} samples)",
        columns=(
            Column("axis"),
            Column("figure"),
            Column("value", number),
            Column("sigma", ".2g"),
            Column("unit"),
            Column("SI", number),
            Column("SI unit"),
            Column("note"),
        ),
        rows=rows,
    )


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


# Rig key: kind of axis, coefficient (None for the Gauss-Markov figures), unit, its size in SI.
_RIG = {
    "angle_random_walk": ("gyro", "random_walk", "deg/sqrt(h)", units.DEG_PER_ROOT_HOUR),
    "bias_instability": ("gyro", "bias_instability", "deg/h", units.DEG_PER_HOUR),
    "rate_random_walk": ("gyro", "rate_random_walk", "deg/h/sqrt(s)", units.DEG_PER_HOUR),
    "velocity_random_walk": (
        "accel",
        "random_walk",
        "m/s/sqrt(h)",
        units.METRE_PER_SECOND_PER_ROOT_HOUR,
    ),
    "accel_bias_instability": ("accel", "bias_instability", "m/s^2", 1.0),
    "gauss_markov_gyro_sigma": ("gyro", "sigma", "deg/h", units.DEG_PER_HOUR),
    "gauss_markov_gyro_time": ("gyro", "time", "s", 1.0),
    "gauss_markov_accel_sigma": ("accel", "sigma", "m/s^2", 1.0),
    "gauss_markov_accel_time": ("accel", "time", "s", 1.0),
}


def rig_figures(result: AllanResult) -> dict[str, float | list[float]]:
    """Return what a rig's [imu] can hold of the result, in the rig's units, four digits.

    A list of x, y, z where all three axes have the figure; their root mean square where only
    some have; nothing where none has.
    """
    figures: dict[str, float | list[float]] = {}
    for key, (kind, name, _, size) in _RIG.items():
        values = []
        for axis in "xyz":
            noise = result.axes.get(f"{kind}_{axis}")
            if noise is None:
                continue
            if name in ("sigma", "time"):
                value = getattr(noise.gauss_markov, name)
            else:
                value = noise.fit.coefficients[name].value
            if value is not None:
                values.append(float(f"{value / size:.4g}"))
        if len(values) == 3:
            figures[key] = values
        elif values:
            figures[key] = float(f"{math.sqrt(sum(v * v for v in values) / len(values)):.4g}")
    return figures


def write_to_rig(path: str, result: AllanResult) -> dict[str, float | list[float]]:
    """Write the measured figures into the [imu] table of a rig file; return what was written.

    Comments, order and every other key stay; a figure the record does not give stays as it was.
    A file that is not there is made.

    Raises RigError when the file cannot be read or written, or would not be a rig.
    """
    import tomlkit
    from tomlkit.exceptions import TOMLKitError

    figures = rig_figures(result)
    place = Path(path)
    try:
        text = read_text(place) if place.exists() else ""
        document = tomlkit.parse(text)
    except OSError as fault:
        raise RigError(f"{path}: cannot be read: {fault.strerror or fault}") from fault
    except (UnicodeDecodeError, TOMLKitError) as fault:
        raise RigError(f"{path}: not TOML: {fault}; correct the file") from fault
    imu = document.setdefault("imu", tomlkit.table())
    if not isinstance(imu, dict):
        raise RigError(f"{path}: imu: {imu!r} is not a table; correct the file")
    for key, value in figures.items():
        known = key in imu
        imu[key] = value
        if not known and isinstance(imu, tomlkit.items.Table):
            imu[key].comment(f"{_RIG[key][2]}, measured")
    written = tomlkit.dumps(document)
    rig_from_dict(tomllib.loads(written), path)
    try:
        with atomic_write(place) as stream:
            stream.write(written.encode())
    except OSError as fault:
        raise RigError(f"{path}: cannot be written: {fault.strerror or fault}") from fault
    return figures
