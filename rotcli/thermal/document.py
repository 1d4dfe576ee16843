"""A thermal test as a result document (kind `calibration`, model `thermal`), and back."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rotcli.files.results.documents import quantity
from rotcli.models.mean_covariance import Goodness
from rotcli.models.sensors import AXIS_COLUMN_NAMES, BIAS_NAMES
from rotcli.thermal.basis import Chebyshev, Hats
from rotcli.thermal.estimate import ChannelResult, ThermalResult
from rotcli.thermal.lag import DirectionTest
from rotcli.thermal.warm_up import WarmUp
from rotcli.units import DEG, DEG_PER_HOUR, PPM

KIND = "calibration"
MODEL = "thermal"
WARM_UP_KIND = "warm-up"
EQUATION = (
    "gyro = (I + k(T) u^T) w + d(T), accel = f + b(T); u: table axis, T: temperature (degC); "
    "w = (I + k(T) u^T)^-1 (gyro - d(T))"
)
_BIAS_UNIT = {"gyro": ("deg/h", DEG_PER_HOUR), "accel": ("m/s^2", 1.0)}
_CURVE_STEP = 0.5  # degC between the stored points of a curve; d'' of 3 deg/h/degC^2: 0.1 deg/h
_MAX_CURVE_POINTS = 401


def to_fields(result: ThermalResult) -> dict[str, Any]:
    """Return the document's fields: degC, deg/h (m/s^2) and ppm."""
    return {
        "model": MODEL,
        "equation": EQUATION,
        "axis": result.axis_name if result.axis_name != "u" else result.axis,
        "rate": quantity(_largest_rate(result) / DEG, None, "deg/s"),
        "horizon": {"start_s": result.horizon[0], "end_s": result.horizon[1]},
        "temperature": {
            "low": result.low,
            "high": result.high,
            "largest_gap": result.gap,
            "reference": result.reference,
            "unit": "degC",
        },
        "parameters": _parameters(result),
        "goodness": {
            f"{kind}_{name}": _goodness(channel.goodness)
            for kind, name, channel in _channels(result)
        },
        "channels": {
            f"{kind}_{name}": _channel(kind, channel, result)
            for kind, name, channel in _channels(result)
        },
        "curve": _curve(result),
        "blocks": [
            {
                "log": k,
                "start_s": float(log.start[i]),
                "end_s": float(log.end[i]),
                "rate_dps": float(log.rate[i]) / DEG,
                "temperature_degC": float(log.temperature[i]),
                "heating_degC_per_min": 60.0 * float(log.heating[i]),
                "error_dph": log.mean[i] / DEG_PER_HOUR,
            }
            for k, log in enumerate(result.logs)
            if log.temperature is not None and log.heating is not None
            for i in range(len(log))
        ],
        "findings": [finding.to_dict() for finding in result.findings],
    }


def _largest_rate(result: ThermalResult) -> float:
    return max(float(np.max(np.abs(log.rate))) for log in result.logs)


def _channels(result: ThermalResult) -> list[tuple[str, str, ChannelResult]]:
    return [
        (kind, name, channel)
        for kind, channels in (("gyro", result.gyro), ("accel", result.accel))
        for name, channel in channels.items()
    ]


def _parameters(result: ThermalResult) -> dict[str, Any]:
    """Return bias and scale factor at the reference temperature."""
    at = np.array([result.reference])
    found = {}
    for name, parameter in zip("xyz", BIAS_NAMES, strict=True):
        fit = result.gyro[name].fit
        bias = fit.bias(at, fit.problem.horizon(*result.horizon))
        found[parameter] = _quantity(bias.value[0], bias.sigma[0], "deg/h", DEG_PER_HOUR)
    for name, parameter in zip("xyz", AXIS_COLUMN_NAMES[result.axis_name], strict=True):
        fit = result.gyro[name].fit
        if fit.scale_basis is not None:
            scale = fit.scale(at)
            found[parameter] = _quantity(scale.value[0], scale.sigma[0], "ppm", PPM)
    return found


def _quantity(value: float, sigma: float | None, unit: str, to_si: float) -> dict[str, Any]:
    return quantity(float(value) / to_si, None if sigma is None else float(sigma) / to_si, unit)


def _goodness(test: Goodness) -> dict[str, Any]:
    return {
        "chi2": test.chi2,
        "dof": test.dof,
        "low": test.low,
        "high": test.high,
        "sigma_factor": test.sigma_factor,
    }


def _channel(kind: str, channel: ChannelResult, result: ThermalResult) -> dict[str, Any]:
    """Return everything about one sensor."""
    unit, to_si = _BIAS_UNIT[kind]
    fit = channel.fit
    knots = fit.bias_basis.knots if isinstance(fit.bias_basis, Hats) else None
    scale_order = None
    if knots is None and fit.scale_basis is not None:
        scale_order = fit.scale_basis.size - 1
    return {
        "bias_order": fit.bias_basis.size - 1 if knots is None else None,
        "knots_degC": knots,
        "scale_order": scale_order,
        "bic": None
        if channel.selection is None
        else [
            {"bias_order": p, "scale_order": q if q >= 0 else None, "bic": one.bic}
            for (p, q), one in channel.selection.fits.items()
        ],
        "powers": _powers(kind, channel, result),
        "soaks": [
            {
                "temperature_degC": float(channel.soaks[i]),
                "bias": _quantity(channel.bias.value[i], channel.bias.sigma[i], unit, to_si),
                "bias_own_span": _quantity(
                    channel.bias_own.value[i], channel.bias_own.sigma[i], unit, to_si
                ),
                "scale": None
                if channel.scale is None
                else _quantity(channel.scale.value[i], channel.scale.sigma[i], "ppm", PPM),
            }
            for i in range(len(channel.soaks))
        ],
        "difference": _quantity(*channel.difference, unit, to_si),
        "sensitivity": {
            "mean": channel.sensitivity[0] / to_si,
            "largest": channel.sensitivity[1] / to_si,
            "unit": f"{unit}/degC",
        },
        "residual_before": _size(channel.residual_before, unit, to_si),
        "residual_after": _size(channel.residual_after, unit, to_si),
        "left_out_soaks": None
        if channel.left_out is None
        else {
            "rms": channel.left_out.rms / to_si,
            "unit": unit,
            "chi2_per_value": channel.left_out.chi2_per_value,
            "temperatures_degC": channel.left_out.temperatures,
        },
        "directions": _directions(channel.directions, unit, to_si),
        "lag": None
        if channel.lag is None
        else {**quantity(channel.lag.lag, channel.lag.sigma, "s"), "chi2": channel.lag.chi2},
    }


def _size(pair: tuple[float, float], unit: str, to_si: float) -> dict[str, Any]:
    return {"rms": pair[0] / to_si, "peak": pair[1] / to_si, "unit": unit}


def _powers(kind: str, channel: ChannelResult, result: ThermalResult) -> dict[str, Any] | None:
    """Return the coefficients about the reference temperature with their covariances."""
    unit, to_si = _BIAS_UNIT[kind]
    fit = channel.fit
    if not isinstance(fit.bias_basis, Chebyshev):
        return None
    bias = fit.bias_powers(result.reference, fit.problem.horizon(*result.horizon))
    found: dict[str, Any] = {
        "bias": {
            "value": bias.value / to_si,
            "sigma": bias.sigma / to_si,
            "covariance": bias.covariance / to_si**2,
            "unit": f"{unit}/degC^n",
        }
    }
    if fit.scale_basis is not None:
        scale = fit.scale_powers(result.reference)
        found["scale"] = {
            "value": scale.value / PPM,
            "sigma": scale.sigma / PPM,
            "covariance": scale.covariance / PPM**2,
            "unit": "ppm/degC^n",
        }
    return found


def _directions(test: DirectionTest | None, unit: str, to_si: float) -> dict[str, Any] | None:
    if test is None:
        return None
    return {
        "p_value": test.p_value,
        "significant": test.significant,
        "rate_term": _quantity(
            test.rate_term / 60.0, test.rate_sigma / 60.0, f"{unit} per degC/min", to_si
        ),
        "offset": _quantity(test.offset, test.offset_sigma, unit, to_si),
        "largest": _quantity(test.largest, test.largest_sigma, unit, to_si),
    }


def _curve(result: ThermalResult) -> dict[str, Any]:
    """Return bias and scale factor at temperatures over the range, as the correction uses them.

    The stored points are those of the polynomial; between them it is interpolated by a cubic.
    """
    count = min(_MAX_CURVE_POINTS, max(5, int((result.high - result.low) / _CURVE_STEP) + 2))
    T = np.linspace(result.low, result.high, count)
    hats = isinstance(result.gyro["x"].fit.bias_basis, Hats)
    curve: dict[str, Any] = {"temperature_degC": T, "between": "line" if hats else "cubic"}
    for kind, name, channel in _channels(result):
        fit, (unit, to_si) = channel.fit, _BIAS_UNIT[kind]
        bias = fit.bias(T, fit.problem.horizon(*result.horizon))
        entry: dict[str, Any] = {
            "bias": bias.value / to_si,
            "bias_sigma": bias.sigma / to_si,
            "bias_own_span": fit.bias(T, fit.problem.own_span()).value / to_si,
            "unit": unit,
        }
        if fit.scale_basis is not None:
            scale = fit.scale(T)
            entry["scale_ppm"], entry["scale_sigma_ppm"] = scale.value / PPM, scale.sigma / PPM
        curve[f"{kind}_{name}"] = entry
    return curve


def one_line_summary(doc: Mapping[str, Any]) -> str:
    """Return the result in one line."""
    T = doc["temperature"]
    worst = max(
        (c for n, c in doc["channels"].items() if n.startswith("gyro")),
        key=lambda c: abs(c["sensitivity"]["largest"]),
    )
    return (
        f"bias over {T['low']:.1f} to {T['high']:.1f} degC: up to "
        f"{abs(worst['sensitivity']['largest']):.2f} deg/h/degC, "
        + ("hat functions" if worst["bias_order"] is None else f"order {worst['bias_order']}")
    )


def warm_up_fields(
    found: dict[str, WarmUp | None],
    limits: dict[str, float],
    horizon: tuple[float, float],
    constants: dict[str, tuple[float, float]],
) -> dict[str, Any]:
    """Return the fields of a warm-up document (kind `warm-up`).

    found: per channel (gyro_x …), None where it cannot be fitted; limits: rad/s within which the
    bias must stay; constants: bias after the warm-up and its sigma, rad/s.
    """
    channels: dict[str, Any] = {}
    for name, one in found.items():
        if one is None:
            channels[name] = None
            continue
        value, sigma = constants[name]
        channels[name] = {
            "accepted": one.accepted,
            "reasons": list(one.reasons),
            "amplitude": _quantity(one.amplitude, one.amplitude_sigma, "deg/h", DEG_PER_HOUR),
            "time_constant": quantity(one.tau, one.tau_sigma, "s"),
            "sigma_ln_tau": one.sigma_ln_tau,
            "gain_chi2": one.gain,
            "bias_after": _quantity(value, sigma, "deg/h", DEG_PER_HOUR),
            "limit": limits[name] / DEG_PER_HOUR,
            "warm_up_time_s": one.time_within(limits[name]) if one.accepted else 0.0,
        }
    times = [c["warm_up_time_s"] for c in channels.values() if c is not None]
    return {
        "equation": "bias(t) = c + A exp(-t / tau), t: s after power-on",
        "horizon": {"start_s": horizon[0], "end_s": horizon[1]},
        "warm_up_time_s": max(times, default=0.0),
        "channels": channels,
    }
