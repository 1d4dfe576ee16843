"""Navigate one run in one or several modes: settings and logs in, results with documents out."""

import logging
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, ClassVar, Literal

from rotcli.dataclass import dataclass
from rotcli.files.results.documents import document as result_document
from rotcli.files.results.result import Result
from rotcli.lazy import lazily
from rotcli.navigate import document, modes
from rotcli.navigate.assess import Assessment, assess
from rotcli.navigate.estimate import Summary, navigate_chunks
from rotcli.navigate.place import prepare
from rotcli.navigate.residuals import WindowMeans
from rotcli.run.corrections import biases_of, corrected, neutral_correction
from rotcli.run.findings import texts
from rotcli.units import DEG, FloatArray, format_span

with lazily():
    from rotcli.files import captions
    from rotcli.navigate import plot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.tables import Table
    from rotcli.logs.record import ImuSource, Progress, TableLog
    from rotcli.navigate.estimate import Navigation
    from rotcli.navigate.modes import CompensatedErrors
    from rotcli.navigate.place import Place
    from rotcli.rig.rig import Rig
    from rotcli.run.correction import Correction
    from rotcli.run.corrections import ReadingCorrection
    from rotcli.run.recording import NavigationRun

Mode = Literal["conventional", "partial", "full"]
Span = tuple[float, float]

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class NavigateOptions:
    """Settings of a navigation.

    modes: empty for full with a calibration, conventional without. window, static: s on the log's
    clock; None: those of the rig, else found. height: free diverges as in the papers.
    """

    modes: tuple[Mode, ...] = ()
    window: Span | None = None
    static: Span | None = None
    height: Literal["free", "hold"] = "free"
    allow_other_rate: bool = False


@dataclass(frozen=True, eq=False)
class NavigationResult(Result):
    """A navigation in one mode: its document; `series` for the figure, if it was requested."""

    series: dict[str, FloatArray] | None = None
    assessment: "Assessment | None" = None
    constant_rate: bool = True

    kind: ClassVar[str] = document.KIND

    def tables(self) -> "list[Table]":
        """Return the table of errors."""
        return document.tables([self.document])

    def tables_of(self, results: "Sequence[Result]") -> "list[Table]":
        """Return one table a mode."""
        return document.tables([result.document for result in results])

    def one_line_summary(self) -> str:
        """Return mode, duration and horizontal errors in one line."""
        return document.headline(self.document)

    def figure(self) -> "Figure":
        """Return the errors against time; raises ResultError without the series."""
        if self.series is None:
            return super().figure()
        motion = captions.motion(self.document, constant_rate=self.constant_rate)
        title = captions.subject(self.document, self.document["mode"], motion)
        expected = None if self.assessment is None else document.envelope(self.assessment)
        return plot.navigation_errors(self.series, title, captions.log(self.document), expected)


@dataclass(frozen=True, eq=False)
class PreparedNavigation:
    """A run that is ready to navigate: logs, base, errors to compensate per mode.

    runs: log and base of each mode; conventional navigates the readings as they are, the other
    modes those that calibrations of other models have corrected.
    """

    runs: "dict[Mode, tuple[NavigationRun, Place]]"
    rig: "Rig"
    options: NavigateOptions
    correction: "Correction | None"
    errors: "dict[Mode, CompensatedErrors]"

    def navigate(
        self,
        mode: Mode,
        progress: "Progress | None" = None,
        *,
        keep_series: bool = False,
    ) -> "Navigating":
        """Return the navigation in one mode, to iterate over its time series."""
        return Navigating(self, mode, progress, keep_series)


class Navigating:
    """A navigation in progress: iterate over its chunks, then ask for its result."""

    def __init__(
        self, of: PreparedNavigation, mode: Mode, progress: "Progress | None", keep_series: bool
    ) -> None:
        self._of, self._mode, self._progress = of, mode, progress
        self._started = False
        self._run, self._place = of.runs[mode]
        window = self._run.window
        self._summary, self._means = Summary(mode, self._run.rate), WindowMeans(self._run)
        self._kept = document.DownsampledSeries(window.stop - window.start) if keep_series else None

    def chunks(self) -> Iterator[dict[str, FloatArray]]:
        """Yield the time series chunk by chunk, columns with their units."""
        for part in self._parts():
            columns = document.solution(part)
            if self._kept is not None:
                self._kept.add(columns)
            yield columns

    def _parts(self) -> "Iterator[Navigation]":
        """Yield the navigation chunk by chunk and collect its statistics."""
        self._started = True
        _log.info("%s", _describe(self._run, self._mode))
        errors = self._of.errors[self._mode]
        for part in navigate_chunks(
            self._run,
            self._place,
            errors.gyro,
            errors.accel,
            mode=self._mode,
            hold_height=self._of.options.height == "hold",
            progress=self._progress,
            watch=self._means.add,
        ):
            self._summary.add(part)
            yield part

    def finish(self) -> NavigationResult:
        """Return the result; consumes the chunks that were not iterated."""
        if not self._started:
            for _ in self._parts() if self._kept is None else self.chunks():
                pass
        of, run = self._of, self._run
        errors = of.errors[self._mode]
        hold = of.options.height == "hold"
        assessment = assess(
            run,
            self._place,
            of.rig,
            errors,
            of.correction,
            self._summary,
            self._means,
            hold_height=hold,
        )
        findings = assessment.verdict.findings
        warnings = [*run.warnings, *errors.warnings, *self._summary.warnings]
        fields = {
            **document.fields(self._summary),
            **document.assessment_fields(assessment, of.rig),
            "findings": [finding.to_dict() for finding in findings],
            "warnings": [*warnings, *assessment.warnings, *texts(findings)],
        }
        logs = [log for log in (run.imu, run.table) if log]
        doc = result_document(document.KIND, logs, of.rig.effective(), fields)
        series = None if self._kept is None else self._kept.columns()
        return NavigationResult(doc, series, assessment, run.constant_rate)


def prepare_navigation(
    imu: "ImuSource",
    table: "TableLog | None",
    rig: "Rig",
    correction: "Correction | None" = None,
    options: NavigateOptions | None = None,
    readings: "Sequence[ReadingCorrection]" = (),
) -> PreparedNavigation:
    """Check the logs and find the errors that each mode compensates.

    correction: of one axis, checked against the axis and rate of the window; readings: of other
    models, applied to the readings in every mode but conventional.

    Raises LogError for logs that cannot be navigated, ResultError for a calibration that does not
    apply to this IMU, axis or rate.
    """
    options = options or NavigateOptions()
    chosen: tuple[Mode, ...] = options.modes or (
        "full" if correction is not None or readings else "conventional",
    )
    stages = {"static": options.static, "navigation": options.window}
    stages = {key: span for key, span in stages.items() if span is not None}
    rig = rig.override({"stages": stages}) if stages else rig
    if correction is not None:
        correction.check_imu_name(rig.imu.name)
    run, place = prepare(imu, table, rig, need_static="conventional" in chosen)
    runs = dict.fromkeys(chosen, (run, place))
    for mode in chosen if readings else ():
        if mode != modes.CONVENTIONAL:
            applied = readings if mode == modes.FULL else biases_of(readings)
            runs[mode] = prepare(corrected(imu, applied), table, rig, need_static=False)
    any_rate = options.allow_other_rate or set(chosen) == {"conventional"}
    other_rate = modes.rate_mismatch(run, correction, allowed=any_rate)
    if readings and correction is None:
        correction = neutral_correction(readings, run.axis)
    errors: dict[Mode, CompensatedErrors] = {
        mode: modes.removed(
            runs[mode][0],
            runs[mode][1].base,
            mode,
            correction,
            other_rate,
            static_named=options.static is not None,
        )
        for mode in chosen
    }
    return PreparedNavigation(runs, rig, options, correction, errors)


def _describe(run: "NavigationRun", mode: Mode) -> str:
    parts = [f"navigating {mode}, table at {run.rate / DEG:.6g} deg/s"]
    for name, span in (("still", run.static), ("window", run.window)):
        if span is not None:
            first, last = (run.imu.times(slice(k, k + 1))[0] for k in (span.start, span.stop - 1))
            parts.append(f"{name} {format_span(first, last)}")
    return ", ".join(parts)
