"""Noise figures as a result document.

Every coefficient is given in the unit of datasheets with the SI one next to it.
"""

import math
from typing import Any

from rotcli.allan.estimate import AllanResult, AxisNoise
from rotcli.allan.findings import reading_unit
from rotcli.allan.fit.coefficients import Coefficient
from rotcli.allan.fit.goodness import Goodness
from rotcli.allan.numbers import numbers
from rotcli.allan.survey.drift import Drift
from rotcli.files.results.documents import quantity
from rotcli.models.noise_numbers import ACCEL_UNITS, GYRO_UNITS, NoiseUnit

KIND = "allan"


def coefficient_units(axis: str) -> dict[str, NoiseUnit]:
    """Return datasheet unit, its size in SI and the SI unit of each coefficient of an axis."""
    return GYRO_UNITS if axis.startswith("gyro") else ACCEL_UNITS


def deviation_unit(axis: str) -> tuple[str, float]:
    """Return the unit of an axis's deviation and its size in SI: deg/h or ug."""
    name, size, _ = coefficient_units(axis)["bias_instability"]
    return name, size


def fields(result: AllanResult) -> dict[str, Any]:
    """Return the document's own fields."""
    axes = {name: _axis(axis) for name, axis in result.axes.items()}
    return {
        "estimator": result.estimator,
        "window": {"start_s": result.start, "end_s": result.end},
        "used": {
            "seconds": result.samples * result.interval,
            "percent": 100.0 * result.share,
            "segments_s": [list(span) for span in result.segments],
        },
        "samples": result.samples,
        "interval_s": result.interval,
        "axes": axes,
        "numbers": numbers(axes, 1.0 / result.interval),
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
        **({} if axis.rest is None else {"deviation_without_drifts": axis.rest / size}),
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
        "misfit": _misfit(axis),
        "spectrum": _spectrum(axis),
        "clipping": _clipping(axis),
        "drifts": [_drift(axis.name, drift) for drift in axis.drifts],
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


def _misfit(axis: AxisNoise) -> dict[str, Any] | None:
    """Return the comparison with all cluster times, where some had to be excluded or none fits."""
    if axis.misfit is None:
        return None
    good = axis.misfit.goodness
    return {
        "chi2": good.chi2,
        "dof": good.dof,
        "p_value": good.p_value,
        "largest_percent": 100.0 * good.largest,
        "largest_tau_s": good.largest_tau,
        "excluded_tau_s": list(axis.misfit.excluded),
    }


def _clipping(axis: AxisNoise) -> dict[str, Any] | None:
    if axis.clipping is None:
        return None
    unit, size = reading_unit(axis.name)
    return {
        "value": axis.clipping.value / size,
        "unit": unit,
        "percent": 100.0 * axis.clipping.share,
    }


def _drift(axis: str, drift: Drift) -> dict[str, Any]:
    unit, size = deviation_unit(axis)
    per = "/degC" if drift.kind == "temperature" else ""
    return {
        "kind": drift.kind,
        "amplitude": quantity(drift.amplitude / size, drift.sigma / size, unit + per),
        "start_s": drift.start if drift.kind != "temperature" else None,
        "time_constant_s": drift.time if drift.kind == "exponential" else None,
        "reference_degC": drift.reference if drift.kind == "temperature" else None,
    }


def _spectrum(axis: AxisNoise) -> dict[str, Any] | None:
    found = axis.spectrum
    if found is None:
        return None
    unit, scale = reading_unit(axis.name)
    return {
        "cutoff_hz": found.cutoff,
        "repeats": found.repeats,
        "source_rate_hz": found.source_rate,
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
        "tau_s": None if found.tau is None else list(found.tau),
        "si": {"value": found.value, "sigma": found.sigma, "unit": si},
    }
