"""Calibrate both triads: logs and settings in, a result with its document out."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.files.results.documents import document as result_document
from rotcli.files.results.result import Result
from rotcli.lazy import lazily
from rotcli.run.correction import KIND
from rotcli.triad import document
from rotcli.triad.result import TriadResult
from rotcli.triad.table.run import TriadOptions, calibrate_on_table

with lazily():
    from rotcli.run import corrections
    from rotcli.triad import merge, plot
    from rotcli.triad.handheld import run as handheld_run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.tables import Table
    from rotcli.logs.record import ImuSource, Progress
    from rotcli.logs.table_axes import AxesLog
    from rotcli.rig.rig import Rig

__all__ = ["TriadCalibration", "TriadOptions", "calibrate_triad", "merge_calibrations"]


@dataclass(frozen=True, eq=False)
class TriadCalibration(Result):
    """A full calibration: its document, and the estimate with its residuals."""

    estimate: TriadResult

    kind: ClassVar[str] = KIND

    def tables(self) -> "list[Table]":
        """Return parameters, residuals by kind of block and directions without data."""
        return document.tables(self.document)

    def one_line_summary(self) -> str:
        """Return method, convention and the largest sigmas in one line."""
        return document.headline(self.document)

    def figure(self) -> "Figure":
        """Return residuals before and after; raises ResultError for merged calibrations."""
        if not self.estimate.series:
            raise ResultError("a merged calibration has no residuals to draw")
        return plot.residual_figure(self.document)


def calibrate_triad(
    imu: "ImuSource",
    table: "AxesLog | None",
    rig: "Rig",
    options: TriadOptions | None = None,
    progress: "Progress | None" = None,
) -> TriadCalibration:
    """Return the calibration of a log on a table of one to three axes, or by hand without one.

    Raises RigError without a site, LogError for logs that the rig does not describe or that have
    too few poses.
    """
    if table is None:
        estimate = handheld_run.calibrate_by_hand(
            imu.crop(float(imu.time[0]), float(imu.time[-1])), rig
        )
        doc = result_document(KIND, [imu], rig.effective(), document.fields(estimate))
        before = list(imu.warnings)
    else:
        estimate = calibrate_on_table(imu, table, rig, options or TriadOptions(), progress)
        doc = result_document(KIND, [imu, table], rig.effective(), document.fields(estimate))
        before = [*imu.warnings, *table.warnings]
    doc["warnings"] = [*before, *doc["warnings"]]
    return TriadCalibration(doc, estimate)


def merge_calibrations(paths: Sequence[str]) -> TriadCalibration:
    """Return one gyro matrix from single-axis calibrations; raises ResultError."""
    columns, docs = [], []
    for path in paths:
        model, doc = corrections.calibration_model(path)
        if model != corrections.DEFAULT_MODEL:
            raise ResultError(f"{path}: model {model}; give results of rotcli calibrate")
        columns.append(merge.read_column(path, doc))
        docs.append(doc)
    names = sorted({_imu_name(doc) for doc in docs})
    if len(names) > 1:
        raise ResultError(
            f"{paths[0]}: the calibrations are of different IMUs ({', '.join(names)}); merge "
            "those of one IMU"
        )
    estimate = merge.merge(columns)
    merged = result_document(KIND, [], docs[0].get("rig", {}), document.fields(estimate))
    merged["inputs"] = [entry for doc in docs for entry in doc.get("inputs", [])]
    return TriadCalibration(merged, estimate)


def _imu_name(doc: dict[str, Any]) -> str:
    rig = doc.get("rig")
    imu = rig.get("imu") if isinstance(rig, dict) else None
    return str(imu.get("name")) if isinstance(imu, dict) else "unnamed"
