"""Numbers ready to write: the rules for axes, random walk and inflation applied to the figures.

Every estimator's "random walk" is K, the rate random walk (Allan slope +1/2, read at 3 s), never
the bias instability B and never the minimum of the Allan curve.
"""

import math
from dataclasses import field

import numpy as np

from rotcli import units
from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.export.figures import ACCELS, GYROS, AxisNoise, SensorFigures
from rotcli.models.noise_numbers import root_mean_square
from rotcli.models.sensors import FLICKER_FLOOR
from rotcli.units import FloatArray

DEFAULT_NAVIGATION = 3600.0  # s, horizon of the walk from B when the rig has no navigation window
WALK_TAU = 3.0  # s, the cluster time at which the Allan deviation of a rate random walk is K


@dataclass(frozen=True)
class Settings:
    """Choices of the user.

    axes: `rms` or `max` over the axes where a format has one value; walk_from: `limit` or `bias`
    where K is not significant; inflate: factor on densities; rate: Hz, None for that of the log.
    navigation: s, for walk_from bias; frame: `sensor` or `frd`; instance: sensor number of an
    autopilot, from 1; device: its PX4 device id.
    """

    axes: str = "rms"
    walk_from: str = "limit"
    inflate: float = 1.0
    rate: float | None = None
    navigation: float | None = None
    frame: str = "sensor"
    instance: int = 1
    device: int = 0


@dataclass(frozen=True, eq=False)
class TriadNumbers:
    """Noise of one triad after the rules, SI, (3,) each; NaN for an axis that was not measured.

    slow: per axis the Gauss-Markov (sigma, time) where it was found and K was not, else None.
    """

    white: FloatArray
    flicker: FloatArray
    walk: FloatArray
    slow: tuple[tuple[float, float] | None, ...] = (None, None, None)

    def one(self, values: FloatArray, rule: str) -> float:
        """Return one value for the triad: the root mean square of its axes, or the maximum."""
        present = values[np.isfinite(values)]
        if rule == "max":
            return float(np.max(present))
        return root_mean_square(present)


@dataclass(frozen=True)
class Remark:
    """A rule that was applied to one axis: the figure (a key of FIGURES) and the text."""

    figure: str
    axis: str
    text: str


@dataclass(frozen=True, eq=False)
class Numbers:
    """The figures, the noise of both triads after the rules, and remarks for the header."""

    figures: SensorFigures
    settings: Settings
    gyro: TriadNumbers | None
    accel: TriadNumbers | None
    remarks: tuple["Remark", ...] = field(default=())

    def notes(self, contained: frozenset[str]) -> list[str]:
        """Return the remarks about contained figures as notes, axes with one remark together."""
        axes: dict[str, list[str]] = {}
        for remark in self.remarks:
            if remark.figure in contained:
                axes.setdefault(remark.text, []).append(remark.axis)
        return [f"{', '.join(names)}: {text}" for text, names in axes.items()]

    @property
    def rate(self) -> float:
        """The sample rate (Hz); raises ResultError when no input states it."""
        rate = self.settings.rate or self.figures.rate
        if rate is None:
            raise ResultError(
                f"{_names(self.figures)}: no sample rate; set one or add an allan result"
            )
        return rate

    @property
    def gravity(self) -> float:
        """Gravity of the site (m/s^2); standard gravity when no input states a site."""
        return self.figures.gravity or units.STANDARD_GRAVITY

    def noise(self) -> tuple[TriadNumbers, TriadNumbers]:
        """Return gyro and accelerometer noise; raises ResultError when one was not measured."""
        for name, triad in (("gyro", self.gyro), ("accelerometer", self.accel)):
            if triad is None:
                raise ResultError(
                    f"{_names(self.figures)}: no {name} noise; add an allan result with these axes"
                )
        assert self.gyro is not None
        assert self.accel is not None
        return self.gyro, self.accel

    def single(self, quantity: str) -> tuple[float, float]:
        """Return one SI value for gyro and accelerometer: `white`, `flicker` or `walk`."""
        gyro, accel = self.noise()
        rule = self.settings.axes
        return gyro.one(getattr(gyro, quantity), rule), accel.one(getattr(accel, quantity), rule)


def prepare(figures: SensorFigures, settings: Settings) -> Numbers:
    """Apply the rules of axes, random walk and inflation.

    Raises ResultError when an axis has neither a value nor a limit.
    """
    remarks: list[Remark] = []
    gyro = _triad(figures, settings, GYROS, remarks)
    accel = _triad(figures, settings, ACCELS, remarks)
    return Numbers(figures, settings, gyro, accel, tuple(remarks))


def _triad(
    figures: SensorFigures, settings: Settings, axes: tuple[str, ...], remarks: list[Remark]
) -> TriadNumbers | None:
    present = [axis for axis in axes if axis in figures.noise]
    if not present:
        return None
    white, flicker, walk = np.full((3, 3), math.nan)
    slow: list[tuple[float, float] | None] = [None, None, None]
    for axis in present:
        noise, k = figures.noise[axis], axes.index(axis)
        white[k] = _white(figures, axis, noise, remarks)
        flicker[k] = _flicker(axis, noise, remarks)
        walk[k] = _walk(figures, settings, axis, noise, remarks)
        if noise.walk.value is None and noise.markov_sigma and noise.markov_time:
            slow[k] = (settings.inflate * noise.markov_sigma, noise.markov_time)
    factor = settings.inflate
    return TriadNumbers(factor * white, factor * flicker, factor * walk, tuple(slow))


def _white(figures: SensorFigures, axis: str, noise: AxisNoise, remarks: list[Remark]) -> float:
    if noise.white.value is not None:
        return noise.white.value
    if noise.white.upper is None:
        raise ResultError(f"{_names(figures)}: {axis}: no random walk N; record a longer still log")
    remarks.append(Remark("white", axis, "N is not significant; its 95 % upper limit is written"))
    return noise.white.upper


def _flicker(axis: str, noise: AxisNoise, remarks: list[Remark]) -> float:
    if noise.flicker.value is not None:
        return noise.flicker.value
    if noise.flicker.upper is None:
        return math.nan
    text = "B is not significant; its 95 % upper limit is written"
    remarks.append(Remark("flicker", axis, text))
    return noise.flicker.upper


def _walk(
    figures: SensorFigures, settings: Settings, axis: str, noise: AxisNoise, remarks: list[Remark]
) -> float:
    if noise.walk.value is not None:
        return noise.walk.value
    if settings.walk_from == "bias":
        flicker = noise.flicker.value if noise.flicker.value is not None else noise.flicker.upper
        if flicker is None:
            raise ResultError(f"{_names(figures)}: {axis}: K and B are unknown; use the limit of K")
        time = settings.navigation or figures.navigation or DEFAULT_NAVIGATION
        source = "B" if noise.flicker.value is not None else "the upper limit of B"
        text = (
            f"K is not significant; K = 0.6643 B sqrt(3 s/T) from {source} is written, "
            f"T = {time:.6g} s (the walk whose Allan deviation equals the floor at T)"
        )
        remarks.append(Remark("walk", axis, text))
        return walk_from_bias(flicker, time)
    if noise.walk.upper is None:
        raise ResultError(
            f"{_names(figures)}: {axis}: neither K nor its limit; record a longer still log"
        )
    text = "K is not significant; its 95 % upper limit is written, not a measurement"
    remarks.append(Remark("walk", axis, text))
    return noise.walk.upper


def walk_from_bias(flicker: float, time: float) -> float:
    """Return the K whose Allan deviation at `time` (s) equals the floor 0.6643 B.

    >>> f"{walk_from_bias(7.592182e-5, 3600.0):.4g}"
    '1.456e-06'
    """
    return FLICKER_FLOOR * flicker * math.sqrt(WALK_TAU / time)


def _names(figures: SensorFigures) -> str:
    return ", ".join(source.path for source in figures.sources) or "no input"


def write_number(value: float) -> str:
    """Return a number with 10 digits that YAML 1.1, C and MATLAB all read as a real number.

    >>> write_number(100.0), write_number(8e-4), write_number(1.0 / 3.0 * 1e-9)
    ('100.0', '0.0008', '3.333333333e-10')
    """
    text = f"{value:.10g}"
    mantissa, mark, exponent = text.partition("e")
    if "." not in mantissa:
        mantissa += ".0"
    return mantissa + mark + exponent
