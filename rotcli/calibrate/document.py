"""A calibration as a result document and as a table."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli import units
from rotcli.files.results.documents import quantity
from rotcli.files.tables import Column, Table
from rotcli.units import FloatArray

if TYPE_CHECKING:  # reading a document needs no estimate
    from rotcli.calibrate.estimate import Calibration
    from rotcli.calibrate.limits import LimitTest
    from rotcli.run.consistency.goodness import GyroTest


def fields(result: "Calibration") -> dict[str, Any]:
    """Return the document's own fields: biases in deg/h, matrix elements in ppm."""
    unit = np.array([units.PPM] * 3 + [units.DEG_PER_HOUR] * 3)
    names = ["ppm"] * 3 + ["deg/h"] * 3
    sigma = np.sqrt(np.diag(result.covariance)) / unit
    values = result.values / unit
    order = [3, 4, 5, 0, 1, 2]  # biases first, as the tables have them
    return {
        "axis": result.axis_name if result.axis_name != "u" else result.axis,
        "rate": quantity(result.rate / units.DEG, None, "deg/s"),
        "parameters": {result.names[k]: quantity(values[k], sigma[k], names[k]) for k in order},
        "covariance": {
            "order": [result.names[k] for k in order],
            "units": [names[k] for k in order],
            "matrix": (result.covariance / np.outer(unit, unit))[np.ix_(order, order)],
        },
        "segments": _segments(result),
        "horizon": _horizon(result),
        "goodness": _goodness(result),
        "lag": None if result.lag is None else quantity(result.lag * 1e3, None, "ms"),
        "residual_rms": _by_axis(result.residual_rms / units.DEG, "deg/s"),
        "angle_random_walk": _by_axis(result.white / units.DEG_PER_ROOT_HOUR, "deg/sqrt(h)"),
        "predicted_sigma": {
            "bias": quantity(result.predicted_bias / units.DEG_PER_HOUR, None, "deg/h"),
            "scale": quantity(result.predicted_column / units.PPM, None, "ppm"),
        },
        "mean_after": _mean_after(result),
    }


def _mean_after(result: "Calibration") -> dict[str, Any]:
    """Return the mean corrected gyros out of sample, with the sigma of what they are expected."""
    mean, after = result.corrected_mean_rate / units.DEG, result.out_of_sample
    sigma = np.full(3, np.nan) if after is None else after.sigma / units.DEG
    return {
        axis: quantity(value, None if np.isnan(of) else float(of), "deg/s")
        for axis, value, of in zip("xyz", mean, sigma, strict=True)
    }


def _by_axis(values: FloatArray, unit: str) -> dict[str, Any]:
    return {axis: quantity(v, None, unit) for axis, v in zip("xyz", values, strict=True)}


def _segments(result: "Calibration") -> list[dict[str, float]]:
    return [
        {
            "start_s": segment.start,
            "end_s": segment.end,
            "rate_dps": segment.rate / units.DEG,
            "angle_deg": segment.angle / units.DEG,
        }
        for segment in result.segments
    ]


def _horizon(result: "Calibration") -> dict[str, Any]:
    return {
        "start_s": result.horizon[0],
        "end_s": result.horizon[1],
        "sigma_own_span": {
            name: quantity(sigma / units.DEG_PER_HOUR, None, "deg/h")
            for name, sigma in zip(result.names[3:], result.own_sigma, strict=True)
        },
    }


def _goodness(result: "Calibration") -> dict[str, Any]:
    gyros = {
        axis: {
            "chi2": test.chi2,
            "dof": test.dof,
            "limit": test.limit if test.dof else None,
            "verdict": _verdict(test),
            "sigma_factor": test.sigma_factor,
        }
        for axis, test in zip("xyz", result.test.gyros, strict=True)
    }
    return gyros | {name: _limit_test(test) for name, test in result.limit_tests.items()}


def _limit_test(test: "LimitTest | None") -> dict[str, Any]:
    """Return figure, limit and verdict of a test."""
    if test is None:
        return {"value": None, "limit": None, "verdict": "not tested"}
    dof = {} if test.dof is None else {"dof": test.dof}
    verdict = "contradicted" if test.exceeded else "consistent"
    where = test.where or None
    return {"value": test.value, **dof, "limit": test.limit, "verdict": verdict, "where": where}


def _verdict(test: "GyroTest") -> str:
    """Return the verdict of a test of fit in one word."""
    if not test.dof:
        return "not tested"
    return "contradicted" if test.contradicted else "consistent"


def residuals(time: FloatArray, left: FloatArray) -> dict[str, FloatArray]:
    """Return what the fit leaves (n, 3), rad/s, at times (n,), s, as columns with their units."""
    named = {
        f"residual_{axis} [deg/s]": column / units.DEG
        for axis, column in zip("xyz", left.T, strict=True)
    }
    return {"time [s]": time, **named}


def table(doc: Mapping[str, Any]) -> Table:
    """Return the parameters of a calibration document as a readable table."""
    rate = doc["rate"]["value"]
    predicted = doc["predicted_sigma"]
    return Table(
        title=f"Calibration about {doc['axis']} at {rate:.6g} deg/s",
        columns=(
            Column("parameter"),
            Column("value", ".2f"),
            Column("sigma", ".2f"),
            Column("unit"),
        ),
        rows=[(name, p["value"], p["sigma"], p["unit"]) for name, p in doc["parameters"].items()],
        note=f"{definitions(list(doc['parameters']))} Mean gyro output after correction, deg/s: "
        + ", ".join(f"{axis} {_mean(q)}" for axis, q in doc["mean_after"].items())
        + ". Sigma from white noise only (R16 eq. 35, 36): bias "
        + _shown(predicted["bias"])
        + ", scale and installation "
        + _shown(predicted["scale"])
        + " (36 takes the bias as known; still and turning segments of one length: sqrt(2) times).",
    )


def definitions(names: Sequence[str]) -> str:
    """Return what each parameter is, and the equation of correction.

    >>> definitions(["bias_x", "Kgxz", "Kgz"]).partition(". ")[0]
    'Correction: w = (I + K u^T)^-1 (gyro - bias), u the table axis, K its column'
    """
    elements = [name for name in names if name.startswith("Kg")]
    parts = [
        f"{name} scale factor of gyro {name[2:]}"
        if len(name) == 3
        else f"{name} installation error, share of the rate about {_axis_word(name[3:])} that "
        f"gyro {name[2]} measures"
        for name in elements
    ]
    return (
        "Correction: w = (I + K u^T)^-1 (gyro - bias), u the table axis, K its column. "
        + "; ".join([*parts, "bias_x, bias_y, bias_z biases of the gyros"])
        + ". Values with 1 sigma."
    )


def _axis_word(letter: str) -> str:
    return "the axis u" if letter == "u" else letter


def headline(doc: Mapping[str, Any]) -> str:
    """Return the result of a calibration document in one line."""
    sigmas = dict.fromkeys(("deg/h", "ppm"), 0.0)
    for p in doc["parameters"].values():
        sigmas[p["unit"]] = max(sigmas[p["unit"]], p["sigma"])
    return (
        f"calibration about {doc['axis']} at {doc['rate']['value']:.5g} deg/s: biases to "
        f"{units.digits(sigmas['deg/h'], 2)} deg/h, scale factor and installation to "
        f"{units.digits(sigmas['ppm'], 2)} ppm"
    )


def _mean(q: Mapping[str, Any]) -> str:
    return "unknown" if q["value"] is None else f"{q['value']:.5f}"


def _shown(q: Mapping[str, Any]) -> str:
    return "unknown" if q["value"] is None else f"{q['value']:.1f} {q['unit']}"
