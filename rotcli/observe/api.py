"""Observability of a motion, and the ZUPT filter on a log: settings in, a result out."""

import logging
from collections.abc import Callable
from dataclasses import field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from rotcli.dataclass import dataclass
from rotcli.files.results.documents import document as result_document
from rotcli.files.results.documents import write_result
from rotcli.files.results.result import Result
from rotcli.lazy import lazily
from rotcli.models.earth import gravity_at
from rotcli.models.rotation import axis_rotation, euler_angles
from rotcli.models.sensors import TriadErrors
from rotcli.observe import document
from rotcli.observe.observability import TableMotion, analyse, sweep
from rotcli.rig.rig import DEFAULT_SITE, Rig
from rotcli.units import DEG

with lazily():
    from rotcli.observe import plot, zupt, zupt_files

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.tables import Table
    from rotcli.logs.record import ImuSource, Progress, TableLog
    from rotcli.observe.zupt import Options, ZuptResult
    from rotcli.run.correction import Correction

# Writes a time series that comes chunk by chunk; None: the series is not written.
SeriesWriter = Callable[[Any], None]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class MotionOptions:
    """Settings of the motion that is analysed.

    rate: deg/s, None for a still table; accelerations (m/s^2, east north up): one per segment.
    """

    rate: float | None = 10.0
    model: Literal["simplified", "full"] = "simplified"
    accelerations: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True)
class SweepOptions:
    """Settings of a sweep: parameter and its values in deg or deg/s."""

    parameter: Literal["roll", "pitch", "rate"]
    start: float
    stop: float
    step: float


@dataclass(frozen=True, eq=False)
class ObservabilityResult(Result):
    """An observability analysis, with the estimates of the filter if there was a log."""

    filtered: "ZuptResult | None" = None
    logs: list[Any] = field(default_factory=list)
    rig: Rig | None = None

    kind: ClassVar[str] = document.KIND

    def tables(self) -> "list[Table]":
        """Return the table of states, or of the sweep."""
        return [document.table(self.document)]

    def figure(self) -> "Figure":
        """Return the sweep, or the estimates against time."""
        if "sweep" in self.document:
            figure: Figure = plot.sweep_figure(self.document)
        else:
            figure = plot.estimates_figure([self.document])
        return figure

    def save_calibration(self, path: str, correction: "Correction | None") -> list[str]:
        """Write the reliable bias estimates as a calibration; return the excluded ones.

        Raises ResultError when no estimate is reliable.
        """
        assert self.filtered is not None
        assert self.rig is not None
        unreliable = self.document["filter"]["not_to_be_used"]
        fields = zupt_files.calibration_fields(self.filtered, correction, unreliable)
        fields["warnings"] = self.warnings
        doc = result_document(zupt_files.CALIBRATION_KIND, self.logs, self.rig.effective(), fields)
        write_result(path, doc)
        return list(fields["left_out"])


def motion_of(rig: Rig, options: MotionOptions) -> TableMotion:
    """Return the motion that rig and options describe."""
    site, u = rig.site or DEFAULT_SITE, rig.table.axis
    return TableMotion(
        axis=None if options.rate is None else (float(u[0]), float(u[1]), float(u[2])),
        rate=0.0 if options.rate is None else options.rate * DEG,
        pitch=rig.attitude.pitch or 0.0,
        roll=rig.attitude.roll or 0.0,
        azimuth=rig.attitude.azimuth or 0.0,
        latitude=site.latitude,
        gravity=gravity_at(site.latitude, site.height, site.gravity),
        model=options.model,
        accelerations=options.accelerations,
    )


def analyse_motion(
    rig: Rig, options: MotionOptions | None = None, swept: SweepOptions | None = None
) -> ObservabilityResult:
    """Return rank, observable states and combinations of a motion, and along a sweep.

    Raises RotcliError for an impossible motion.
    """
    motion = motion_of(rig, options or MotionOptions())
    result = analyse(motion)
    fields = {**document.fields(result), "warnings": []}
    if swept is not None:
        limits = (swept.start * DEG, swept.stop * DEG, swept.step * DEG)
        found = sweep(motion, swept.parameter, *limits)
        fields["sweep"] = document.sweep_fields(found, result.n.states)
    doc = result_document(document.KIND, [], rig.effective(), fields)
    return ObservabilityResult(doc, rig=rig)


def filter_logs(
    imu: "ImuSource",
    table: "TableLog | None",
    rig: Rig,
    filter_options: "Options",
    motion_options: MotionOptions | None = None,
    correction: "Correction | None" = None,
    noise_rig: Rig | None = None,
    *,
    progress: "Progress | None" = None,
    write_series: SeriesWriter | None = None,
    series_is_stream: bool = False,
) -> ObservabilityResult:
    """Run the ZUPT filter on a log and analyse the observability of its motion.

    noise_rig: rig with the noise figures, if they are not those of `rig`. write_series: takes the
    time series chunk by chunk; series_is_stream: its output cannot be repeated. Raises LogError.
    """
    gyro_errors = accel_errors = None
    if correction is not None:
        correction.check_imu_name(rig.imu.name)
        gyro_errors = correction.gyro_errors(full=correction.gyro_column is not None)
        accel_errors = TriadErrors(bias=correction.accel_bias)
    _log.info("filtering with updates at %g Hz", filter_options.update_rate)
    run = zupt.prepare_zupt(imu, table, noise_rig or rig, filter_options, gyro_errors, accel_errors)
    filtered = _filter(run, progress, write_series, series_is_stream=series_is_stream)
    warnings = list(filtered.warnings)
    if correction is not None and filtered.rate:
        rate_mismatch = correction.check_applies(
            filtered.settings.axis, filtered.rate, constant_rate=True
        )
        warnings += [rate_mismatch] if rate_mismatch else []
    rate = filtered.rate / DEG if filtered.rate else None
    motion = motion_of(rig, replace(motion_options or MotionOptions(), rate=rate))
    motion = _at_angle(motion, filtered.angle, rig)
    simplified_analysis = analyse(replace(motion, model="simplified"))
    fields = {
        **document.fields(analyse(motion)),
        "filter": document.filter_fields(filtered, simplified_analysis),
        "warnings": warnings,
        "findings": [finding.to_dict() for finding in filtered.findings],
    }
    logs = [log for log in (imu, table) if log is not None]
    doc = result_document(document.KIND, logs, rig.effective(), fields)
    return ObservabilityResult(doc, filtered, logs, rig)


def _filter(
    run: Any, progress: "Progress | None", write: SeriesWriter | None, *, series_is_stream: bool
) -> "ZuptResult":
    """Filter a run, once more about the estimated attitude where the table is off the nominal.

    A stream takes the series of the last pass only.
    """
    first_pass = None if series_is_stream else write
    try:
        result = _run_pass(run, progress, first_pass)
        return _run_pass(run, progress, write) if series_is_stream and write else result
    except zupt.AttitudeOffsetError as found:
        _log.info("filtering again, about the estimated attitude of the table")
        return _run_pass(found.run, progress, write)


def _run_pass(run: Any, progress: "Progress | None", write: SeriesWriter | None) -> "ZuptResult":
    """Filter a run once; a pass that ends in AttitudeOffsetError leaves no time series."""
    summary = zupt.ZuptHistory(run)
    parts = summary.watch(zupt.estimate_parts(run, progress))
    if write is not None:
        write(zupt_files.solution_parts(run, parts))
    else:
        for _ in parts:
            pass
    return summary.result()


def _at_angle(motion: TableMotion, angle: float, rig: Rig) -> TableMotion:
    """Return the motion; of a still table with the sensor attitude at its table angle."""
    if motion.axis is not None or angle == 0.0:
        return motion
    pitch, roll, azimuth = euler_angles(motion.C_nb @ axis_rotation(rig.table.axis, angle))
    return replace(motion, pitch=float(pitch), roll=float(roll), azimuth=float(azimuth))
