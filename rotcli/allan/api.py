"""Analyse the noise of one still log: settings and log in, a result with its document out."""

import logging
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, ClassVar, Literal

from rotcli.allan import document, rig_file
from rotcli.allan.estimate import AllanResult as AllanEstimate
from rotcli.allan.estimate import allan
from rotcli.allan.numbers import numbers_table
from rotcli.allan.tables import curve_table, goodness_table, noise_table
from rotcli.dataclass import dataclass
from rotcli.files.channels import AXES
from rotcli.files.results.documents import document as result_document
from rotcli.files.results.result import Result
from rotcli.lazy import lazily
from rotcli.units import format_span

with lazily():
    from rotcli.allan import compare
    from rotcli.allan import plot as drawing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.tables import Table
    from rotcli.logs.record import ImuSource
    from rotcli.rig.rig import Rig

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class AllanOptions:
    """Settings of a noise analysis.

    window: s on the log's clock; taus: octave, decade, all, times in s, or None for 15 a decade;
    despike: interpolate isolated readings of 8 sigma and more; panels: `psd`, `autocorrelation`,
    drawn next to the curves.
    """

    window: tuple[float, float] | None = None
    axes: tuple[str, ...] = AXES
    taus: str | tuple[float, ...] | None = None
    estimator: Literal["oadev", "adev", "mdev", "totdev"] = "oadev"
    despike: bool = False
    panels: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class AllanResult(Result):
    """A noise analysis: its document, and the estimate in SI."""

    estimate: AllanEstimate
    panels: tuple[str, ...] = ()

    kind: ClassVar[str] = document.KIND

    def tables(self) -> "list[Table]":
        """Return the tables of figures, goodness of fit, numbers to use, and the curve."""
        doc = self.document
        tables = [noise_table(doc), goodness_table(doc), numbers_table(doc), curve_table(doc)]
        return [table for table in tables if table is not None]

    def tables_of(self, results: "Sequence[Result]") -> "list[Table]":
        """Return the tables of one log, or the table with a column for each of several logs."""
        return (
            self.tables() if len(results) == 1 else [compare.comparison_table(_compared(results))]
        )

    def one_line_summary(self) -> str:
        """Return log, duration and number of axes in one line."""
        estimate = self.estimate
        path = self.document["inputs"][0]["path"]
        return f"noise of {path}, {estimate.end - estimate.start:.6g} s, {len(estimate.axes)} axes"

    def figure(self) -> "Figure":
        """Return the Allan deviations with their limits and fitted terms, and the panels."""
        return drawing.allan_figure(self.estimate, self.document, self.panels)

    def write_to_rig(self, path: str) -> list[str]:
        """Write the figures into the [imu] table of a rig; return the keys written."""
        return list(rig_file.write_to_rig(path, self.estimate))


def comparison_figure(results: Sequence[AllanResult], *, marks: bool = False) -> "Figure":
    """Return the curves of several logs, a panel for each axis.

    marks: also the lowest deviations that R16 figure 6 has for its IMUs.
    """
    return compare.comparison_figure(_compared(results), marks=marks)


def _compared(results: "Sequence[Result]") -> "list[compare.Compared]":
    own = [result for result in results if isinstance(result, AllanResult)]
    return compare.labelled([(result.estimate, result.document) for result in own])


def allan_log(
    log: "ImuSource",
    rig: "Rig",
    options: AllanOptions | None = None,
    progress: Callable[[float], None] | None = None,
) -> AllanResult:
    """Analyse the clean still segments of a log, or of a window of it.

    Raises LogError when no clean segment is long enough, or an axis is constant.
    """
    options = options or AllanOptions()
    taus = list(options.taus) if isinstance(options.taus, tuple) else options.taus
    estimate = allan(
        log,
        window=options.window,
        axes=options.axes,
        taus=taus,
        estimator=options.estimator,
        gyro_range=rig.imu.gyro_range,
        accel_range=rig.imu.accel_range,
        despike=options.despike,
        progress=progress,
    )
    span = format_span(estimate.start, estimate.end)
    _log.info("still segment %s, %d samples", span, estimate.samples)
    fields = document.fields(estimate)
    doc = result_document(document.KIND, [log], rig.effective(), fields)
    return AllanResult(doc, estimate, options.panels)
