"""Bias and scale factor over temperature, read from documents of model `thermal`."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from rotcli import units
from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.units import FloatArray

_BIAS_SIZES = {"deg/h": units.DEG_PER_HOUR, "m/s^2": 1.0}
_CURVE_ORDER = 3  # of the polynomial that replaces a curve between knots


@dataclass(frozen=True)
class Source:
    """One input document: path, kind, SHA-256 of its bytes."""

    path: str
    kind: str
    sha256: str


@dataclass(frozen=True, eq=False)
class Thermal:
    """Bias and scale factor over temperature: powers of (T - reference), degC, lowest first.

    gyro: (3, p) rad/s/degC^n; accel: (3, p) m/s^2/degC^n or None; scale: (3, q) of the gyros'
    diagonal, or None. Rows with unknown coefficients are NaN. residual: largest difference that
    the replacement of a curve between knots by a cubic added, rad/s and m/s^2.
    """

    reference: float
    low: float
    high: float
    gyro: FloatArray
    accel: FloatArray | None = None
    scale: FloatArray | None = None
    residual: tuple[float, float] = (0.0, 0.0)


def read_thermal(source: Source, doc: Mapping[str, Any], earlier: Thermal | None) -> Thermal:
    """Return the temperature model of a document; scale rows of an earlier one are kept.

    Each test excites one axis, so three documents give the scale factors of three gyros.
    """
    span = doc["temperature"]
    # Rounded to what a thermometer can mean: a range that starts at 1e-27 degC starts at 0.
    reference, low, high = (round(float(span[key]), 6) for key in ("reference", "low", "high"))
    channels, curve = doc["channels"], doc.get("curve") or {}
    read = _Reader(source, channels, curve, reference, (low, high))
    gyro, gyro_residual = read.bias("gyro")
    if gyro is None:
        raise ResultError(f"{source.path}: no gyro bias over temperature; create it again")
    accel, accel_residual = read.bias("accel")
    scale = read.scale(doc.get("axis"))
    if earlier is not None and earlier.scale is not None and earlier.reference == reference:
        scale = _merged(earlier.scale, scale)
    residual = (gyro_residual, accel_residual)
    return Thermal(reference, low, high, gyro, accel, scale, residual)


@dataclass(frozen=True, eq=False)
class _Reader:
    source: Source
    channels: Mapping[str, Any]
    curve: Mapping[str, Any]
    reference: float
    span: tuple[float, float]

    def bias(self, kind: str) -> tuple[FloatArray | None, float]:
        """Return the powers (3, p) of a triad in SI, None without it, and the added residual."""
        rows: list[FloatArray] = []
        residual = 0.0
        for axis in "xyz":
            channel = self.channels.get(f"{kind}_{axis}")
            if channel is None:
                rows.append(np.full(1, math.nan))
                continue
            powers = (channel.get("powers") or {}).get("bias")
            if powers is not None:
                size = self._size(str(powers["unit"]).removesuffix("/degC^n"))
                rows.append(size * np.asarray(powers["value"], dtype=float))
            else:
                row, added = self._cubic(f"{kind}_{axis}")
                rows.append(row)
                residual = max(residual, added)
        known = any(np.isfinite(row).all() for row in rows)
        return (_stacked(rows) if known else None), residual

    def _size(self, unit: str) -> float:
        if unit not in _BIAS_SIZES:
            raise ResultError(
                f"{self.source.path}: bias over temperature in {unit!r}; create it again"
            )
        return _BIAS_SIZES[unit]

    def _cubic(self, channel: str) -> tuple[FloatArray, float]:
        """Return the cubic that replaces a curve between knots, SI, and its largest error."""
        T = np.asarray(self.curve["temperature_degC"], dtype=float)
        entry = self.curve[channel]
        values = self._size(str(entry["unit"])) * np.asarray(entry["bias"], dtype=float)
        low, high = self.span
        t = (2.0 * T - low - high) / (high - low)
        fitted = chebyshev.chebfit(t, values, _CURVE_ORDER)
        residual = float(np.max(np.abs(values - chebyshev.chebval(t, fitted))))
        slope = 2.0 / (high - low)
        at_reference = np.polynomial.Polynomial(
            [slope * (self.reference - 0.5 * (low + high)), slope]
        )
        powers = np.polynomial.Polynomial(chebyshev.cheb2poly(fitted))(at_reference).coef
        return np.pad(powers, (0, _CURVE_ORDER + 1 - len(powers))), residual

    def scale(self, axis: Any) -> FloatArray | None:
        """Return the powers (3, q) of the diagonal scale factors; only the tested axis is known."""
        if axis not in ("x", "y", "z"):
            return None
        powers = ((self.channels.get(f"gyro_{axis}") or {}).get("powers") or {}).get("scale")
        if powers is None:
            return None
        values = units.PPM * np.asarray(powers["value"], dtype=float)
        rows = [values if a == axis else np.full(1, math.nan) for a in "xyz"]
        return _stacked(rows)


def _stacked(rows: list[FloatArray]) -> FloatArray:
    """Return rows of different length as one array; shorter ones end with zeros, NaN stays."""
    size = max(len(row) for row in rows)
    return np.array(
        [
            np.pad(row, (0, size - len(row))) if np.isfinite(row).all() else np.full(size, math.nan)
            for row in rows
        ]
    )


def _merged(earlier: FloatArray, scale: FloatArray | None) -> FloatArray:
    """Return the known rows of both; the later document wins."""
    if scale is None:
        return earlier
    size = max(earlier.shape[1], scale.shape[1])
    one, two = (np.pad(rows, ((0, 0), (0, size - rows.shape[1]))) for rows in (earlier, scale))
    return np.where(np.isfinite(two).all(axis=1, keepdims=True), two, one)
