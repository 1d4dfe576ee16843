"""Residuals of a calibration against time and against the table angle.

Means of a good fit are within a few of the sigmas that white noise causes, without a trend
(warm-up) and without a period of one turn (g-sensitivity, wrong azimuth, an eccentric encoder).
"""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from rotcli.files import captions
from rotcli.files.figures import INK, SERIES, legend_above, panels, plain, styled
from rotcli.units import DEG, DEG_PER_HOUR, FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Times (n,), s; table angles (n,), rad; residuals (n, 3), rad/s.
Chunk = tuple[FloatArray, FloatArray, FloatArray]

BLOCK = 1.0  # s, of a mean against time
BINS = 24  # of a turn, 15 deg each
_MIN_TURNS = 1.0  # fewer show no period of a turn


class ResidualMeans:
    """Means of residuals over blocks of time and over bins of the table angle."""

    def __init__(self, interval: float, block: float = BLOCK) -> None:
        """Start without data; interval: of the samples, s."""
        self._count = max(1, round(block / interval))
        self.block = self._count * interval
        self._times: list[FloatArray] = []
        self._means: list[FloatArray] = []
        self._sums = np.zeros((BINS, 3))
        self._in_bin = np.zeros(BINS)
        self.turned = 0.0  # rad

    def add(self, time: FloatArray, angle: FloatArray, residual: FloatArray) -> None:
        """Add consecutive samples; an incomplete last block is omitted."""
        complete = len(time) // self._count * self._count
        if complete:
            shape = (-1, self._count)
            self._times.append(time[:complete].reshape(shape).mean(axis=1))
            self._means.append(residual[:complete].reshape(*shape, 3).mean(axis=1))
        swept = float(np.ptp(angle)) if len(angle) else 0.0
        self.turned += swept
        if swept > np.pi:  # a still segment has no angle to compare
            place = np.floor(np.mod(angle, 2.0 * np.pi) / (2.0 * np.pi) * BINS).astype(np.int64)
            place = np.minimum(place, BINS - 1)
            self._in_bin += np.bincount(place, minlength=BINS)
            for k in range(3):
                self._sums[:, k] += np.bincount(place, residual[:, k], minlength=BINS)

    @property
    def against_time(self) -> tuple[FloatArray, FloatArray]:
        """Times (m,), s, and means (m, 3), rad/s."""
        if not self._times:
            return np.empty(0), np.empty((0, 3))
        return np.concatenate(self._times), np.concatenate(self._means)

    @property
    def against_angle(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Middle of each bin (b,), rad, its means (b, 3), rad/s, and its number of samples (b,)."""
        used = self._in_bin > 0
        middle = (np.arange(BINS) + 0.5) * 2.0 * np.pi / BINS
        return middle[used], self._sums[used] / self._in_bin[used, None], self._in_bin[used]


def residual_figure(
    doc: Mapping[str, Any], chunks: Iterable[Chunk], interval: float, white: FloatArray
) -> "Figure":
    """Draw the residuals of a calibration: means over 1 s against time, and over bins of angle.

    white: (3,) rad/sqrt(s), angle random walk behind the sigmas; shaded is 1 sigma of a mean.
    """
    means = ResidualMeans(interval)
    for chunk in chunks:
        means.add(*chunk)
    title = captions.subject(doc, "residuals of the calibration", captions.motion(doc))
    return _draw(means, float(white.max()), title, captions.log(doc), interval)


@styled()
def _draw(means: ResidualMeans, white: float, title: str, source: str, interval: float) -> "Figure":
    with_angle = means.turned > _MIN_TURNS * 2.0 * np.pi
    fig, axes = panels(1 + with_angle, 2.1, title, share=False, source=source)
    time, value = means.against_time
    start = float(time[0]) if len(time) else 0.0
    _panel(axes[0], time - start, value, white / np.sqrt(means.block))
    axes[0].set_xlabel(f"time since the first segment, s (means over {means.block:g} s)")
    legend_above(axes[0], 4)
    if with_angle:
        angle, value, count = means.against_angle
        _panel(axes[1], angle / DEG, value, white / np.sqrt(count.mean() * interval))
        axes[1].set_xlabel(f"table angle, deg (means over {360 // BINS} deg)")
        axes[1].set_xticks(range(0, 361, 60))
    return fig


def _panel(panel: Any, x: FloatArray, values: FloatArray, sigma: float) -> None:
    size = sigma / DEG_PER_HOUR
    panel.axhspan(-size, size, facecolor="#e6e6e6", edgecolor="none", zorder=0, label="1 sigma")
    panel.axhline(0.0, color=INK, linewidth=0.6)
    for k, (axis, look) in enumerate(zip("xyz", SERIES, strict=True)):
        style = {**look, "linestyle": "none", "markersize": 2.6}
        panel.plot(x, values[:, k] / DEG_PER_HOUR, label=plain(f"gyro_{axis}"), **style)
    panel.set_ylabel("residual, deg/h")
    panel.margins(x=0.01)
