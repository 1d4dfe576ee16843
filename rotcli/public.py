"""The public API: what the commands do, for notebooks and scripts.

A log is a path or an object of `read_imu`, `read_table`; a rig is a path, an object of `read_rig`,
or None for rig.toml in the folder of the IMU log, else the default rig. Every function returns a
result with `.to_frame()` (pandas), `.to_dict()`, `.write(path)` and `.plot(path)`; its settings are
the fields of the options class named in its docstring.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rotcli.allan.api import AllanOptions, AllanResult, allan_log
from rotcli.calibrate.api import CalibrateOptions, CalibrationResult, calibrate_logs
from rotcli.dataclass import dataclass
from rotcli.lazy import lazily
from rotcli.logs import stream
from rotcli.logs import table as table_logs
from rotcli.logs.plausible import check_spans
from rotcli.logs.record import ImuSource, TableLog
from rotcli.logs.table_axes import AxesLog, read_table_axes
from rotcli.logs.temperature import read_temperature
from rotcli.navigate.api import Mode, NavigateOptions, NavigationResult, prepare_navigation
from rotcli.observe.api import (
    MotionOptions,
    ObservabilityResult,
    analyse_motion,
    filter_logs,
)
from rotcli.observe.zupt import Options as ZuptOptions
from rotcli.plan.api import PlanOptions, PlanResult, plan_sequence
from rotcli.rig import rig as rigs
from rotcli.rig.rig import Rig
from rotcli.run.correction import Correction, correction_from_document, read_correction
from rotcli.run.laboratory.turn_on import TurnOn
from rotcli.scale.api import ScaleOptions, ScaleTest, scale_logs
from rotcli.simulate.api import (
    SimulatedRun,
    SimulateOptions,
    scenario_from_options,
    simulate_run,
)
from rotcli.thermal.api import (
    ThermalOptions,
    ThermalTest,
    WarmUpOptions,
    WarmUpTest,
    thermal_logs,
    warm_up_log,
)
from rotcli.triad.api import TriadCalibration, TriadOptions, calibrate_triad

with lazily():
    from rotcli.navigate import document as navigation_document

if TYPE_CHECKING:
    from pandas import DataFrame

    from rotcli.files.tables import Table

PathOrRig = str | Path | Rig | None
PathOrImu = str | Path | ImuSource
PathOrTable = str | Path | TableLog


@dataclass(frozen=True, eq=False)
class NavigationResults:
    """The results of one run in several modes, in the order of the modes."""

    modes: dict[str, NavigationResult]

    def __getitem__(self, mode: str) -> NavigationResult:
        return self.modes[mode]

    def tables(self) -> "list[Table]":
        """Return one table a mode."""
        results = list(self.modes.values())
        return results[0].tables_of(results)

    def to_frame(self) -> "DataFrame":
        """Return the errors of all modes side by side."""
        return navigation_document.side_by_side(
            [result.document for result in self.modes.values()]
        ).to_frame()


def read_rig(path: str | Path | None = None) -> Rig:
    """Return the rig of a file, or the default rig; raises RigError."""
    return rigs.default_rig() if path is None else rigs.read_rig(str(path))


def read_imu(path: str | Path, rig: PathOrRig = None, *, max_gap: int | None = 5) -> ImuSource:
    """Return an IMU log in SI: gyro (n, 3) rad/s, accel (n, 3) m/s^2; raises LogError.

    max_gap: longest gap, in samples, that is interpolated; None: any gap.
    """
    return stream.open_imu(path, _rig(rig, path), max_gap=max_gap)


def read_table(path: str | Path, rig: PathOrRig = None) -> TableLog:
    """Return a table log: time (n,) s and angle (n,) rad, unwrapped; raises LogError."""
    return table_logs.read_table(path, _rig(rig, path))


def allan(
    imu: PathOrImu, rig: PathOrRig = None, options: AllanOptions | None = None
) -> AllanResult:
    """Measure the noise of a still log; settings: `AllanOptions`."""
    chosen = _rig(rig, imu)
    return allan_log(_imu(imu, chosen, max_gap=None), chosen, options)


def calibrate(
    imu: PathOrImu,
    table: PathOrTable,
    rig: PathOrRig = None,
    options: CalibrateOptions | None = None,
) -> CalibrationResult:
    """Estimate biases, scale factor and installation errors; settings: `CalibrateOptions`."""
    chosen = _rig(rig, imu)
    logs = _run(imu, table, chosen)
    return calibrate_logs(*logs, chosen, options)


def scale(
    imu: PathOrImu,
    table: PathOrTable,
    rig: PathOrRig = None,
    options: ScaleOptions | None = None,
    *,
    more: Sequence[tuple[PathOrImu, PathOrTable]] = (),
) -> ScaleTest:
    """Measure the scale factor over rates; settings: `ScaleOptions`; more: further turn-ons."""
    return scale_logs([_turn_on(*pair, rig) for pair in ((imu, table), *more)], options)


def triad(
    imu: PathOrImu,
    table: str | Path | AxesLog | None = None,
    rig: PathOrRig = None,
    options: TriadOptions | None = None,
) -> TriadCalibration:
    """Calibrate both triads on a table of one to three axes, by hand without a table log."""
    found = _rig(rig, imu)
    angles = table if isinstance(table, AxesLog) or table is None else read_table_axes(table, found)
    return calibrate_triad(_imu(imu, found), angles, found, options)


def plan(options: PlanOptions, rig: PathOrRig = None) -> PlanResult:
    """Plan positions and spins that calibrate both triads best; settings: `PlanOptions`."""
    return plan_sequence(_rig(rig, None), options)


def thermal(
    imu: PathOrImu,
    table: PathOrTable | None = None,
    rig: PathOrRig = None,
    options: ThermalOptions | None = None,
    *,
    more: Sequence[tuple[PathOrImu, PathOrTable | None]] = (),
) -> ThermalTest:
    """Measure bias and scale factor over temperature; settings: `ThermalOptions`.

    more: further turn-ons. Raises LogError for a log without temperature.
    """
    return thermal_logs([_turn_on(*pair, rig) for pair in ((imu, table), *more)], options)


def warm_up(
    imu: PathOrImu, rig: PathOrRig = None, options: WarmUpOptions | None = None
) -> WarmUpTest:
    """Fit the warm-up of a log that is still from power-on; settings: `WarmUpOptions`."""
    return warm_up_log(_turn_on(imu, None, rig), options)


def navigate(
    imu: PathOrImu,
    table: PathOrTable | None = None,
    rig: PathOrRig = None,
    calibration: str | Path | CalibrationResult | None = None,
    options: NavigateOptions | None = None,
    *,
    keep_series: bool = True,
) -> NavigationResults:
    """Run inertial navigation in one or several modes; settings: `NavigateOptions`.

    keep_series: keep the errors against time, for `.plot()`.
    """
    chosen = _rig(rig, imu)
    imu_log, table_log = _logs(imu, table, chosen)
    correction: Correction | None = None
    if isinstance(calibration, CalibrationResult):
        correction = correction_from_document(calibration.document, "calibration")
    elif calibration is not None:
        correction = read_correction(str(calibration))
    prepared = prepare_navigation(imu_log, table_log, chosen, correction, options)
    modes: Sequence[Mode] = tuple(prepared.errors)
    return NavigationResults(
        {mode: prepared.navigate(mode, keep_series=keep_series).finish() for mode in modes}
    )


def observe(
    imu: PathOrImu | None = None,
    table: PathOrTable | None = None,
    rig: PathOrRig = None,
    options: MotionOptions | None = None,
    filter_options: ZuptOptions | None = None,
) -> ObservabilityResult:
    """Analyse what a motion makes observable; with a log, run the ZUPT filter on it.

    Settings: `MotionOptions`, and `rotcli.observe.zupt.Options` of the filter.
    """
    if imu is None:
        return analyse_motion(_rig(rig, None), options)
    chosen = _rig(rig, imu)
    imu_log, table_log = _logs(imu, table, chosen)
    return filter_logs(imu_log, table_log, chosen, filter_options or ZuptOptions(), options)


def simulate(options: SimulateOptions, rig: PathOrRig = None) -> SimulatedRun:
    """Simulate the logs of a run; settings: `SimulateOptions`; write them with `.write(folder)`."""
    return simulate_run(scenario_from_options(options, _rig(rig, None)))


def _turn_on(imu: PathOrImu, table: PathOrTable | None, rig: PathOrRig) -> TurnOn:
    """Return the logs of one turn-on, with the temperature of the IMU log if it has one."""
    chosen = _rig(rig, imu)
    imu_log, table_log = _logs(imu, table, chosen)
    return TurnOn(imu_log, table_log, chosen, read_temperature(imu_log, chosen))


def _rig(rig: PathOrRig, log: PathOrImu | None) -> Rig:
    if isinstance(rig, Rig):
        return rig
    if rig is None and isinstance(log, str | Path):
        candidate = Path(log).with_name("rig.toml")
        rig = candidate if candidate.is_file() else None
    return read_rig(rig)


def _imu(log: PathOrImu, rig: Rig, *, max_gap: int | None = 5) -> ImuSource:
    return read_imu(log, rig, max_gap=max_gap) if isinstance(log, str | Path) else log


def _logs(imu: PathOrImu, table: PathOrTable | None, rig: Rig) -> tuple[ImuSource, TableLog | None]:
    return (_imu(imu, rig), None) if table is None else _run(imu, table, rig)


def _run(imu: PathOrImu, table: PathOrTable, rig: Rig) -> tuple[ImuSource, TableLog]:
    """Return both logs of a run; raises LogError if they do not overlap."""
    imu_log = _imu(imu, rig)
    table_log = read_table(table, rig) if isinstance(table, str | Path) else table
    check_spans(table_log.path, table_log.time, table_log.interval, imu_log.time)
    return imu_log, table_log
