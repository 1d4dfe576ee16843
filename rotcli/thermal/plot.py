"""Plots of thermal tests (bias, scale factor, residuals) and of warm-ups."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.files import captions
from rotcli.files.figures import SERIES, legend_above, panels, styled
from rotcli.files.results.groups import Source

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.figures import Drawing

_SOAK = 0.1  # degC/min, below which a block has no direction


def thermal_figures(sources: Sequence[Source]) -> "list[Drawing]":
    """Return the figures of several documents, for a report."""
    return [(f"Bias over temperature, {s.imu}", partial(thermal_figure, s.doc)) for s in sources]


@styled()
def thermal_figure(doc: Mapping[str, Any]) -> "Figure":
    """Draw bias, scale factor and residuals of the gyros over temperature.

    Bands: one sigma of the predicted bias. Triangles up: heating, down: cooling, dots: soaks.
    """
    turning = any("scale_ppm" in doc["curve"][f"gyro_{a}"] for a in "xyz")
    title = captions.subject(doc, "bias and scale factor over temperature")
    fig, axes = panels(3 if turning else 2, 2.1, title, source=captions.log(doc))
    T = np.array(doc["curve"]["temperature_degC"])
    blocks = _Blocks(doc)
    for k, (axis, style) in enumerate(zip("xyz", SERIES, strict=True)):
        curve, color = doc["curve"][f"gyro_{axis}"], style["color"]
        bias, sigma = np.array(curve["bias"]), np.array(curve["bias_sigma"])
        axes[0].plot(T, bias, label=f"gyro {axis}", color=color, linestyle=style["linestyle"])
        axes[0].fill_between(T, bias - sigma, bias + sigma, color=color, alpha=0.15, linewidth=0)
        measured, residual = blocks.bias(k, T, curve)
        blocks.draw(axes[0], measured, color)
        if turning:
            K, s = np.array(curve["scale_ppm"]), np.array(curve["scale_sigma_ppm"])
            axes[1].plot(T, K, color=color, linestyle=style["linestyle"])
            axes[1].fill_between(T, K - s, K + s, color=color, alpha=0.15, linewidth=0)
        blocks.draw(axes[-1], residual, color)
    axes[0].set_ylabel("bias (deg/h)")
    if turning:
        axes[1].set_ylabel("scale factor (ppm)")
    axes[-1].axhline(0.0, color="#222222", linewidth=0.6)
    axes[-1].set_ylabel("residual (deg/h)")
    axes[-1].set_xlabel("temperature (degC)\nup: heating, down: cooling, dots: soaks")
    legend_above(axes[0], 3)
    return fig


class _Blocks:
    """The block means of a document."""

    def __init__(self, doc: Mapping[str, Any]) -> None:
        rows = doc["blocks"]
        self.T = np.array([row["temperature_degC"] for row in rows])
        self.rate = np.array([row["rate_dps"] for row in rows])
        self.heating = np.array([row["heating_degC_per_min"] for row in rows])
        self.error = np.array([row["error_dph"] for row in rows]).reshape(-1, 3)

    def bias(self, k: int, T: Any, curve: Mapping[str, Any]) -> tuple[Any, Any]:
        """Return the means without the scale factor's part, and minus the bias curve."""
        value = self.error[:, k]
        if "scale_ppm" in curve:
            value = value - np.interp(self.T, T, curve["scale_ppm"]) * 1e-6 * self.rate * 3600.0
        return value, value - np.interp(self.T, T, curve["bias_own_span"])

    def draw(self, panel: Any, value: Any, color: str) -> None:
        """Draw values (k,) over temperature, heating and cooling with their markers."""
        for marker, chosen in (
            ("^", self.heating >= _SOAK),
            ("v", self.heating <= -_SOAK),
            (".", np.abs(self.heating) < _SOAK),
        ):
            panel.plot(
                self.T[chosen],
                value[chosen],
                color=color,
                marker=marker,
                linestyle="",
                markersize=3,
            )


@styled()
def warm_up_figure(doc: Mapping[str, Any], start: Any, end: Any, mean: Any) -> "Figure":
    """Draw block means (k, 3), deg/h, over time after power-on (s) with the fitted warm-ups."""
    fig, axes = panels(1, 3.0, captions.subject(doc, "warm-up"), source=captions.log(doc))
    middle = 0.5 * (start + end) / 60.0
    for k, (axis, style) in enumerate(zip("xyz", SERIES, strict=True)):
        axes[0].plot(middle, mean[:, k], ".", color=style["color"], markersize=2.5)
        c = doc["channels"][f"gyro_{axis}"]
        if c is not None and c["accepted"]:
            decay = np.exp(-60.0 * middle / c["time_constant"]["value"])
            level = np.mean(mean[:, k] - c["amplitude"]["value"] * decay)
            fitted = level + c["amplitude"]["value"] * decay
            axes[0].plot(middle, fitted, color=style["color"], linestyle=style["linestyle"])
        axes[0].plot([], [], color=style["color"], label=f"gyro {axis}")
    axes[0].set_xlabel("time after power-on (min)")
    axes[0].set_ylabel("bias (deg/h)")
    legend_above(axes[0], 3)
    return fig
