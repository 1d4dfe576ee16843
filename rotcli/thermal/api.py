"""Thermal test and warm-up: logs and settings in, a result out."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.files.results.result import Result
from rotcli.lazy import lazily
from rotcli.models.base import FixedBase
from rotcli.models.laboratory.blocks import Blocks
from rotcli.models.sensors import NoiseFigures
from rotcli.run.findings import Finding
from rotcli.run.laboratory.blocks import TEMPERATURE_BLOCK, accel_figures
from rotcli.run.laboratory.turn_on import (
    TurnOn,
    fixed_base,
    gyro_noise,
    laboratory_document,
    reduce_turn_on,
    with_path,
)
from rotcli.thermal.basis import Chebyshev
from rotcli.thermal.document import (
    KIND,
    WARM_UP_KIND,
    one_line_summary,
    to_fields,
    warm_up_fields,
)
from rotcli.thermal.estimate import CHANNELS, HORIZON, ThermalResult, estimate_thermal
from rotcli.thermal.fit import MIN_SWING, MIN_SWING_CURVED
from rotcli.thermal.tables import tables, warm_up_table
from rotcli.thermal.warm_up import WarmUp, allan_minimum, fit_warm_up
from rotcli.units import DEG_PER_HOUR, FloatArray

with lazily():
    from rotcli.thermal import plot


if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.tables import Table
    from rotcli.logs.record import Progress

Span = tuple[float, float]
Triad = tuple[NoiseFigures, NoiseFigures, NoiseFigures]

WARM_UP_BLOCK = 10.0  # s: short against a warm-up of minutes, long against white noise
MIN_BLOCKS = 5  # of a test: two coefficients and something to judge them


@dataclass(frozen=True)
class ThermalOptions:
    """Settings of a thermal test.

    orders: of bias and scale factor, None: smallest BIC. knots: degC of hat functions instead of
    polynomials. reference: degC of the coefficients,
    None: middle of the range. horizon: s on the last log's clock, None: the rig's navigation,
    else the 300 s after the test. block: s.
    """

    orders: tuple[int, int] | None = None
    reference: float | None = None
    horizon: Span | None = None
    block: float = TEMPERATURE_BLOCK
    knots: tuple[float, ...] | None = None
    earth_rate: Literal["compensate", "ignore"] = "compensate"


@dataclass(frozen=True, eq=False)
class ThermalTest(Result):
    """A thermal test: its document, and the estimate in SI."""

    estimate: ThermalResult

    kind: ClassVar[str] = KIND

    def tables(self) -> "list[Table]":
        """Return summary, soaks, coefficients, heating against cooling."""
        return tables(self.document)

    def one_line_summary(self) -> str:
        """Return range and sensitivity in one line."""
        return one_line_summary(self.document)

    def figure(self) -> "Figure":
        """Return bias, scale factor and residuals over temperature."""
        return plot.thermal_figure(self.document)


def thermal_logs(
    runs: Sequence[TurnOn],
    options: ThermalOptions | None = None,
    progress: "Progress | None" = None,
) -> ThermalTest:
    """Return the thermal test of several turn-ons of one IMU.

    Raises LogError where the logs contain no temperature or too small a swing, RigError where
    figures are missing.
    """
    options = options or ThermalOptions()
    rig = runs[-1].rig
    noise, findings = gyro_noise(rig)
    base = fixed_base(rig) if options.earth_rate == "compensate" else None
    gyro, accel, warnings = _reduce(runs, base, options.block, progress)
    figures: dict[str, Triad] = {"gyro": noise}
    of_accel = accel_figures(rig.imu)
    if of_accel is not None:
        figures["accel"] = of_accel
    try:
        result = estimate_thermal(
            gyro,
            accel if of_accel is not None else (),
            figures,
            axis_name=rig.table.axis_name,
            axis=rig.table.axis,
            reference=options.reference,
            horizon=options.horizon or rig.stages.navigation,
            orders=options.orders,
            knots=options.knots,
        )
    except ValueError as error:
        text = f"{error}; record more temperatures or choose a lower order"
        raise LogError(runs[0].imu.path, text) from error
    result = replace(result, findings=(*findings, *with_path(result.findings, runs)))
    doc = laboratory_document(KIND, runs, to_fields(result), warnings, result.findings)
    return ThermalTest(doc, result)


def _reduce(
    runs: Sequence[TurnOn], base: FixedBase | None, length: float, progress: "Progress | None"
) -> tuple[tuple[Blocks, ...], tuple[Blocks, ...], list[str]]:
    """Return the blocks of gyros and accelerometers, and the warnings."""
    gyro, accel, warnings = [], [], []
    for run in runs:
        if run.temperature is None:
            text = "no temperature column; name it temperature [degC] or add a thermometer's log"
            raise LogError(run.imu.path, text, column="temperature")
        reduced, found = reduce_turn_on(run, base, length, progress)
        gyro.append(reduced.gyro)
        if reduced.accel is not None and len(reduced.accel) >= MIN_BLOCKS:
            accel.append(reduced.accel)
        warnings += found
    if sum(map(len, gyro)) < MIN_BLOCKS:
        text = f"{sum(map(len, gyro))} blocks of {length:g} s; {MIN_BLOCKS} are needed"
        raise LogError(runs[0].imu.path, f"{text}: record longer, or use shorter blocks")
    return tuple(gyro), tuple(accel) if len(accel) == len(runs) else (), warnings


@dataclass(frozen=True)
class WarmUpOptions:
    """Settings of a warm-up: power_on, s on the log's clock (None: its first sample).

    limit: rad/s within which the bias must stay, None: the smallest Allan deviation of each gyro.
    """

    power_on: float | None = None
    limit: float | None = None
    horizon: Span | None = None
    block: float = WARM_UP_BLOCK
    earth_rate: Literal["compensate", "ignore"] = "compensate"


@dataclass(frozen=True, eq=False)
class WarmUpTest(Result):
    """A warm-up: its document, the fits per channel and the block means."""

    fits: dict[str, WarmUp | None]
    blocks: Blocks

    kind: ClassVar[str] = WARM_UP_KIND

    def tables(self) -> "list[Table]":
        """Return the table of the gyros."""
        return [warm_up_table(self.document)]

    def one_line_summary(self) -> str:
        """Return the warm-up time in one line."""
        return f"warm-up time {self.document['warm_up_time_s']:.0f} s"

    def figure(self) -> "Figure":
        """Return block means and fits over time."""
        b = self.blocks
        return plot.warm_up_figure(self.document, b.start, b.end, b.mean / DEG_PER_HOUR)


def warm_up_log(
    run: TurnOn, options: WarmUpOptions | None = None, progress: "Progress | None" = None
) -> WarmUpTest:
    """Return the warm-up of the gyros in a log that is still from power-on.

    A bias that the temperature explains is not counted as warm-up over time.
    """
    options = options or WarmUpOptions()
    noise, findings = gyro_noise(run.rig)
    base = fixed_base(run.rig) if options.earth_rate == "compensate" else None
    reduced, warnings = reduce_turn_on(run, base, options.block, progress)
    blocks = reduced.gyro
    if np.any(blocks.rate):
        raise LogError(run.imu.path, "the table turns; a warm-up needs a still log")
    power_on = options.power_on if options.power_on is not None else float(run.imu.time[0])
    if power_on > blocks.start[0] + 1.0:
        raise LogError(run.imu.path, f"power-on at {power_on:g} s is after the first block")
    start, end = blocks.start - power_on, blocks.end - power_on
    last = float(blocks.end[-1])
    horizon = options.horizon or (last, last + HORIZON)
    columns = _temperature_columns(blocks)
    fits: dict[str, WarmUp | None] = {}
    limits: dict[str, float] = {}
    constants: dict[str, tuple[float, float]] = {}
    for i, axis in enumerate(CHANNELS):
        name = f"gyro_{axis}"
        figures = blocks.noise(noise[i])
        fits[name] = fit_warm_up(start, end, blocks.mean[:, i], figures, columns)
        limits[name] = options.limit or allan_minimum(noise[i])
        found = fits[name]
        if found is not None:
            after = found.constant(figures.horizon(*horizon))
            constants[name] = float(after.value[0]), float(after.sigma[0])
    fields = warm_up_fields(fits, limits, horizon, constants)
    findings = [*findings, *_warm_up_findings(run, fits)]
    fields["findings"] = [finding.to_dict() for finding in findings]
    doc = laboratory_document(WARM_UP_KIND, [run], fields, warnings, findings)
    shifted = replace(blocks, start=start, end=end)
    return WarmUpTest(doc, fits, shifted)


def _temperature_columns(blocks: Blocks) -> FloatArray | None:
    """Return the columns of a bias over temperature, None where it hardly changes."""
    T = blocks.temperature
    if T is None or float(np.ptp(T)) < MIN_SWING:
        return None
    order = 2 if float(np.ptp(T)) >= MIN_SWING_CURVED else 1
    return Chebyshev(order, float(np.min(T)), float(np.max(T))).values(T)[:, 1:]


def _warm_up_findings(run: TurnOn, fits: dict[str, WarmUp | None]) -> list[Finding]:
    """Return a finding for a significant change that is no warm-up of known time."""
    found = []
    for name, fit in fits.items():
        if fit is not None and not fit.accepted and "gain" not in fit.reasons:
            found.append(
                Finding(
                    "warm-up-unknown",
                    f"{run.imu.path}: {name} changes after power-on, but the record of "
                    f"{run.imu.time[-1] - run.imu.time[0]:.0f} s is too short for its time "
                    "constant. No warm-up time is given; record longer",
                    where=name,
                    value=fit.tau,
                    unit="s",
                )
            )
    return found
