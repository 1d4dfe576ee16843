"""Calibrate one run: settings and logs in, a result with its document out."""

import logging
from collections.abc import Iterator
from typing import TYPE_CHECKING, ClassVar, Literal

from rotcli.calibrate import document
from rotcli.calibrate.estimate import CalibrateSettings, Calibration, calibrate
from rotcli.calibrate.residuals import residual_chunks
from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.files.results.documents import document as result_document
from rotcli.files.results.result import Result
from rotcli.lazy import lazily
from rotcli.models.base import FixedBase
from rotcli.models.earth import gravity_at
from rotcli.models.rotation import attitude_matrix
from rotcli.run.consistency.rig_noise import slow_noise_of
from rotcli.run.correction import KIND
from rotcli.run.findings import texts
from rotcli.run.recording import calibration_run
from rotcli.units import DEG, FloatArray, format_span

with lazily():
    from rotcli.calibrate import plot
    from rotcli.run.laboratory import warm_up_check

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.tables import Table
    from rotcli.logs.record import ImuSource, Progress, TableLog
    from rotcli.rig.rig import Rig

Span = tuple[float, float]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class CalibrateOptions:
    """Settings of a calibration.

    still, rotation: segments (s on the log's clock) to use; empty: those of the rig, else found.
    earth_rate: compensate it, or ignore it as R16 does. warm_up: result of a warm-up test.
    """

    still: tuple[Span, ...] = ()
    rotation: tuple[Span, ...] = ()
    earth_rate: Literal["compensate", "ignore"] = "compensate"
    warm_up: str | None = None


@dataclass(frozen=True, eq=False)
class CalibrationResult(Result):
    """A calibration: its document, and the estimate in SI."""

    estimate: Calibration
    imu: "ImuSource"
    table: "TableLog"
    base: FixedBase | None

    kind: ClassVar[str] = KIND

    def tables(self) -> "list[Table]":
        """Return the table of parameters."""
        return [document.table(self.document)]

    def one_line_summary(self) -> str:
        """Return axis, rate and sigmas in one line."""
        return document.headline(self.document)

    def residuals(self) -> Iterator[dict[str, FloatArray]]:
        """Yield the residuals of the fit chunk by chunk, columns with their units."""
        for time, _, left in residual_chunks(self.imu, self.table, self.estimate, self.base):
            yield document.residuals(time, left)

    def figure(self) -> "Figure":
        """Return the residuals against time and against the table angle."""
        chunks = residual_chunks(self.imu, self.table, self.estimate, self.base)
        white = self.estimate.white
        return plot.residual_figure(self.document, chunks, self.imu.interval, white)


def calibrate_logs(
    imu: "ImuSource",
    table: "TableLog",
    rig: "Rig",
    options: CalibrateOptions | None = None,
    progress: "Progress | None" = None,
) -> CalibrationResult:
    """Find the segments of a run, check them and calibrate (R16 section 3).

    Raises LogError when the logs cannot support the calibration, RigError when the rig lacks what
    the compensation of Earth rate needs.
    """
    options = options or CalibrateOptions()
    base = base_of(rig) if options.earth_rate == "compensate" else None
    if options.rotation:
        rotation = [list(pair) for pair in options.rotation]
        segmented = rig.override({"stages": {"rotation": rotation}})
    else:
        segmented = rig
    found = calibration_run(imu, table, segmented, options.still)
    for segment in found.segments:
        motion = f"turning at {segment.rate / DEG:.6g} deg/s" if segment.rate else "still"
        _log.info("segment %s, %s", format_span(segment.start, segment.end), motion)
    estimate = calibrate(
        imu,
        table,
        found.segments,
        axis_name=rig.table.axis_name,
        axis=rig.table.axis,
        base=base,
        settings=settings_of(rig),
        uneven=found.uneven,
        explained=any(f.code in ("copied-rows", "table-angle") for f in found.findings),
        progress=progress,
    )
    fields = document.fields(estimate)
    warming = warm_up_check.warm_up_findings(imu, rig, found.segments, options.warm_up)
    findings = [*found.findings, *estimate.findings, *warming]
    fields["warnings"] = [*found.log_warnings, *texts(findings)]
    fields["findings"] = [finding.to_dict() for finding in findings]
    doc = result_document(KIND, [imu, table], rig.effective(), fields)
    return CalibrationResult(doc, estimate, imu, table, base)


def settings_of(rig: "Rig") -> CalibrateSettings:
    """Return what a rig says of the sensors, and the window for which biases are predicted."""
    return CalibrateSettings(
        white=rig.imu.figure("angle_random_walk"),
        slow_noise=slow_noise_of(rig.imu),
        horizon=rig.stages.navigation,
        scale_sigma=rig.imu.figure("scale_sigma"),
        gyro_range=rig.imu.gyro_range,
        azimuth=rig.attitude.azimuth or 0.0,
    )


def base_of(rig: "Rig") -> FixedBase:
    """Return the base whose Earth rate is compensated; raises RigError for a missing key."""
    angles = {name: getattr(rig.attitude, name) for name in ("pitch", "roll", "azimuth")}
    missing = [f"[attitude] {name}" for name, angle in angles.items() if angle is None]
    if rig.site is None:
        missing.insert(0, "[site] latitude")
    if rig.site is None or missing:
        raise RigError(
            f"{rig.path or 'no rig.toml'}: {', '.join(missing)}: missing; the compensation of "
            "Earth rate needs it: add it to the rig, or ignore Earth rate (earth_rate = ignore)"
        )
    site = rig.site
    gravity = gravity_at(site.latitude, site.height, site.gravity)
    return FixedBase(site.latitude, gravity, attitude_matrix(**angles))
