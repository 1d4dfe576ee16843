"""A scale factor test as a result document (kind `calibration`, model `scale`), and back."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from rotcli.files.results.documents import quantity
from rotcli.models.mean_covariance import Goodness, predict
from rotcli.models.sensors import AXIS_COLUMN_NAMES, BIAS_NAMES
from rotcli.scale import estimate as est
from rotcli.scale.curves import MODELS, TABLE
from rotcli.scale.estimate import ChannelResult, ScaleResult, curve_bias, curve_values
from rotcli.scale.figures import Figure
from rotcli.scale.prediction import HORIZON
from rotcli.units import DEG, DEG_PER_HOUR, PPM

KIND = "calibration"
MODEL = "scale"
EQUATION = (
    "gyro = w + d + e(u.w), w: true rate (3), u: table axis, d: bias, e: error curve; "
    "w = gyro - d - e(u.w), three passes from w = gyro - d"
)


def _dph(figure: Figure) -> dict[str, Any]:
    return quantity(figure.value / DEG_PER_HOUR, figure.sigma / DEG_PER_HOUR, "deg/h")


def _ppm(figure: Figure | None) -> dict[str, Any] | None:
    return None if figure is None else quantity(figure.value / PPM, figure.sigma / PPM, "ppm")


def to_fields(result: ScaleResult) -> dict[str, Any]:
    """Return the document's fields; rates in deg/s, errors in deg/h and ppm."""
    rates = result.along.selection.selected.problem.rates
    alpha, norm, limit = result.misalignment
    return {
        "model": MODEL,
        "equation": EQUATION,
        "axis": result.axis_name if result.axis_name != est.ALONG else result.axis,
        "rate": quantity(float(np.max(np.abs(rates))) / DEG, None, "deg/s"),
        "full_scale": {
            **quantity(result.full_scale / DEG, None, "deg/s"),
            "source": "rated range" if result.rated else "largest rate of the test",
        },
        "horizon": {"start_s": result.horizon[0], "end_s": result.horizon[1]},
        "parameters": _parameters(result),
        "covariance": _covariance(result),
        "goodness": {name: _goodness(c.goodness) for name, c in result.channels.items()},
        "main": result.main,
        "channels": {name: _channel(c) for name, c in result.channels.items()},
        "misalignment": {
            **quantity(alpha.value / PPM, alpha.sigma / PPM, "urad"),
            "norm": norm / PPM,
            "limit": None if limit is None else limit / PPM,
        },
        "verdict": {
            "deviation": quantity(result.verdict.deviation / DEG_PER_HOUR, None, "deg/h"),
            "rate_dps": result.verdict.rate / DEG,
            "sigma_dph": result.verdict.sigma / DEG_PER_HOUR,
            "run_s": HORIZON,
            "good": result.verdict.good,
            "up_to_s": result.verdict.up_to,
            "any_run": result.verdict.up_to == float("inf"),
        },
        "repeatability": _repeatability(result),
        "curve": _curve(result),
        "segments": [
            {
                "log": k,
                "start_s": float(log.start[i]),
                "end_s": float(log.end[i]),
                "rate_dps": float(log.rate[i]) / DEG,
                "error_dph": log.mean[i] / DEG_PER_HOUR,
            }
            for k, log in enumerate(result.logs)
            for i in range(len(log))
        ],
        "findings": [finding.to_dict() for finding in result.findings],
    }


def _parameters(result: ScaleResult) -> dict[str, Any]:
    """Return biases of the curves (deg/h) and scale factor and installation errors (ppm)."""
    found = {}
    for name, parameter in zip("xyz", BIAS_NAMES, strict=True):
        bias = curve_bias(result.channels[name], result.horizon)
        found[parameter] = _dph(Figure(float(bias.value[0]), float(bias.sigma[0])))
    for name, parameter in zip("xyz", AXIS_COLUMN_NAMES[result.axis_name], strict=True):
        K = result.channels[name].scale
        found[parameter] = quantity(K.value / PPM, K.sigma / PPM, "ppm")
    return found


def _covariance(result: ScaleResult) -> dict[str, Any]:
    """Return the covariance of the parameters: gyros are independent of each other."""
    names = [*BIAS_NAMES, *AXIS_COLUMN_NAMES[result.axis_name]]
    matrix = np.zeros((6, 6))
    for i, name in enumerate("xyz"):
        fit = result.channels[name].selection.selected
        bias_row = est.bias_row(result.channels[name])
        rows = np.vstack([bias_row, fit.straight_line()[1:]])
        found = predict(fit.gls, rows, np.array([1.0, 0.0]), fit.problem.horizon(*result.horizon))
        unit = np.array([DEG_PER_HOUR, PPM])
        matrix[np.ix_([i, 3 + i], [i, 3 + i])] = found.covariance / np.outer(unit, unit)
    return {"order": names, "units": ["deg/h"] * 3 + ["ppm"] * 3, "matrix": matrix}


def _goodness(test: Goodness) -> dict[str, Any]:
    return {
        "chi2": test.chi2,
        "dof": test.dof,
        "low": test.low,
        "high": test.high,
        "sigma_factor": test.sigma_factor,
    }


def _channel(channel: ChannelResult) -> dict[str, Any]:
    """Return everything about one gyro."""
    selection, fit = channel.selection, channel.selection.selected
    NL, residuals = channel.nonlinearity, channel.residuals
    return {
        "model": selection.model,
        "linear": selection.model == "line",
        "p_line": selection.p_line,
        "tests": selection.tests,
        "bic": {name: found.bic for name, found in selection.fits.items()},
        "repeats": _goodness(channel.goodness_table),
        "scale": _ppm(channel.scale),
        "offset": _dph(Figure(float(channel.bias.value[0]), float(channel.bias.sigma[0]))),
        "offset_own_span": _dph(
            Figure(float(channel.bias_own.value[0]), float(channel.bias_own.sigma[0]))
        ),
        "asymmetry": _ppm(channel.asymmetry),
        "nonlinearity": {
            **quantity(NL.value / PPM, NL.sigma / PPM, "ppm of full scale"),
            "rate_dps": NL.rate / DEG,
            "raw": NL.raw / PPM,
            "raw_limit_95": NL.limit / PPM,
        },
        "composite": quantity(channel.composite / PPM, None, "ppm of full scale"),
        "coefficients": _coefficients(channel),
        "residuals": [
            {
                "rate_dps": float(rate) / DEG,
                "residual_dph": float(value) / DEG_PER_HOUR,
                "sigma_dph": float(sigma) / DEG_PER_HOUR,
                "curve_dph": float(curve) / DEG_PER_HOUR,
                "ppm_full_scale": float(value) / fit.problem.full_scale / PPM,
                "ppm_rate": float(value) / abs(float(rate)) / PPM if abs(rate) > 0.0 else None,
            }
            for rate, value, sigma, curve in zip(
                residuals.rates, residuals.residual, residuals.sigma, residuals.curve, strict=True
            )
        ],
        "parts": _parts(channel),
        "hysteresis": _hysteresis(channel),
        "response_ratio": _response(channel),
    }


def _coefficients(channel: ChannelResult) -> dict[str, Any]:
    """Return the coefficients of the curve, ppm of full scale; empty for a table."""
    fit = channel.selection.selected
    if fit.model == TABLE:
        return {}
    first, unit = len(fit.problem.logs), fit.problem.full_scale * PPM
    return {
        name: quantity(
            float(fit.gls.estimate[first + i]) / unit, float(fit.gls.sigma[first + i]) / unit, "ppm"
        )
        for i, name in enumerate(MODELS[fit.model])
    }


def _parts(channel: ChannelResult) -> list[dict[str, Any]] | None:
    found = channel.parts
    if found is None:
        return None
    return [
        {
            "rate_dps": float(found.rates[i]) / DEG,
            "odd": _dph(Figure(float(found.odd[i]), float(found.odd_sigma[i]))),
            "even": _dph(Figure(float(found.even[i]), float(found.even_sigma[i]))),
        }
        for i in range(len(found.rates))
    ]


def _hysteresis(channel: ChannelResult) -> dict[str, Any] | None:
    found = channel.hysteresis
    if found is None:
        return None
    return {
        **_dph(found.difference),
        "limit": None if found.limit is None else found.limit / DEG_PER_HOUR,
        "per_rate": [
            {
                "rate_dps": float(found.rates[i]) / DEG,
                **_dph(Figure(float(found.per_rate[i]), float(found.per_rate_sigma[i]))),
            }
            for i in range(len(found.rates))
        ],
    }


def _response(channel: ChannelResult) -> dict[str, Any] | None:
    found = channel.response
    if found is None:
        return None
    return {
        "dead_band_dps": None if found.dead_band is None else found.dead_band / DEG,
        "threshold_dps": None if found.threshold is None else found.threshold / DEG,
        "smallest_rate_dps": float(found.rates[0]) / DEG,
        "ratio": [
            {
                "rate_dps": float(found.rates[i]) / DEG,
                **quantity(float(found.ratio[i]), float(found.sigma[i]), "1"),
            }
            for i in range(len(found.rates))
        ],
    }


def _repeatability(result: ScaleResult) -> dict[str, Any] | None:
    found = result.repeatability
    if found is None:
        return None
    return {
        **quantity(found.sigma / PPM, None, "ppm"),
        "low_95": found.low / PPM,
        "high_95": found.high / PPM,
        "logs": found.count,
        "mean": quantity(found.mean / PPM, found.mean_sigma / PPM, "ppm"),
        "per_log": [_ppm(value) for value in result.per_log],
    }


def _curve(result: ScaleResult) -> dict[str, Any]:
    """Return the curves that the correction needs: rates deg/s, errors deg/h."""
    rates = result.along.selection.selected.problem.rates
    gyros = {}
    for name in est.CHANNELS:
        channel = result.channels[name]
        fit = channel.selection.selected
        first = len(fit.problem.logs)
        polynomial = fit.gls.estimate[first:] / DEG_PER_HOUR if fit.model != TABLE else np.zeros(0)
        gyros[name] = {
            "model": fit.model,
            "coefficients_dph": polynomial,
            "values_dph": curve_values(channel, rates) / DEG_PER_HOUR,
            "slope_ppm": channel.scale.value / PPM,
        }
    return {
        "full_scale_dps": result.full_scale / DEG,
        "knots_dps": rates / DEG,
        "gyros": gyros,
    }


def axis_text(doc: Mapping[str, Any]) -> str:
    """Return the axis as x, y, z or a rounded vector."""
    axis = doc["axis"]
    return axis if isinstance(axis, str) else "(" + ", ".join(f"{a:.3g}" for a in axis) + ")"


def one_line_summary(doc: Mapping[str, Any]) -> str:
    """Return the result in one line."""
    main = doc["channels"][doc["main"]]
    scale, NL = main["scale"], main["nonlinearity"]
    if main["linear"]:
        shape = f"no nonlinearity above {NL['raw_limit_95']:.0f} ppm of full scale"
    else:
        shape = (
            f"nonlinearity {NL['value']:.0f} ppm of full scale (sigma {NL['sigma']:.0f}), "
            f"model {main['model']}"
        )
    return (
        f"scale factor about {axis_text(doc)}: {scale['value']:.1f} ppm "
        f"(sigma {scale['sigma']:.1f}), {shape}"
    )
