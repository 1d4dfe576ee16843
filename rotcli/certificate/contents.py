"""The contents of a certificate, typed: what the page shows, in its order."""

from collections.abc import Sequence
from dataclasses import field

from rotcli.dataclass import dataclass
from rotcli.files.results.identity import Identity


@dataclass(frozen=True)
class InputFile:
    """A result document that the certificate rests on, with the logs behind it."""

    path: str
    kind: str
    date: str | None
    sha256: str
    logs: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class ParameterRow:
    """One parameter: last value, sigma, repeatability of the device and of the fleet, verdict.

    turn_ons: values of this parameter among the inputs; mean: over them. limits: as text.
    """

    name: str
    value: float | None
    sigma: float | None
    unit: str
    turn_ons: int = 1
    mean: float | None = None
    turn_on_sigma: float | None = None
    fleet_turn_on: float | None = None
    fleet_day_to_day: float | None = None
    percentile: float | None = None
    trend: str | None = None
    limits: str | None = None
    verdict: str | None = None
    remark: str = ""


@dataclass(frozen=True)
class NoiseRow:
    """One noise coefficient of one axis in both unit systems; value None: below `upper`.

    si: the value in SI units, or the upper limit where there is no value.
    """

    axis: str
    symbol: str
    value: float | None
    upper: float | None
    sigma: float | None
    unit: str
    si: float | None
    si_unit: str
    limits: str | None = None
    verdict: str | None = None


@dataclass(frozen=True)
class FigureRow:
    """One figure of a scale or thermal test: a text per axis x, y, z, or one for all."""

    test: str
    name: str
    cells: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Curves:
    """Data of the small plots: (label, x, y) each; empty for none.

    history: (label, dates, values, sigmas) of the gyro biases over the results.
    """

    allan: Sequence[tuple[str, Sequence[float], Sequence[float]]] = ()
    allan_unit: str = "deg/h"
    scale: Sequence[tuple[str, Sequence[float], Sequence[float]]] = ()
    history: Sequence[tuple[str, Sequence[str], Sequence[float], Sequence[float]]] = ()


@dataclass(frozen=True, eq=False)
class Certificate:
    """All contents of one page. verdict: of all limits together, None without a spec."""

    identity: Identity
    dates: tuple[str, ...]
    inputs: tuple[InputFile, ...]
    spec: str | None
    parameters: tuple[ParameterRow, ...]
    noise: tuple[NoiseRow, ...]
    tests: tuple[FigureRow, ...]
    equations: tuple[str, ...]
    not_tested: tuple[str, ...]
    verdict: str | None
    curves: Curves = field(default_factory=Curves)
    notes: tuple[str, ...] = ()

    @property
    def without_sigma(self) -> tuple[str, ...]:
        """Names of the parameters that have a value without a sigma."""
        return tuple(
            row.name for row in self.parameters if row.value is not None and row.sigma is None
        )

    @property
    def issued(self) -> str:
        """The date of the last result: the same inputs give the same page."""
        return self.dates[-1] if self.dates else "not stated"
