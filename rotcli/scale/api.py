"""Scale factor test of one or several turn-ons: logs and settings in, a result out."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Literal

from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.files.results.result import Result
from rotcli.lazy import lazily
from rotcli.run.laboratory.turn_on import (
    TurnOn,
    fixed_base,
    gyro_noise,
    laboratory_document,
    reduce_turn_on,
    with_path,
)
from rotcli.scale.document import KIND, one_line_summary, to_fields
from rotcli.scale.estimate import ScaleResult, estimate_scale
from rotcli.scale.tables import tables

with lazily():
    from rotcli.scale import plot


if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotcli.files.tables import Table
    from rotcli.logs.record import Progress

Span = tuple[float, float]


@dataclass(frozen=True)
class ScaleOptions:
    """Settings of a scale factor test.

    model: error curve, None: chosen by test. full_scale: rad/s, None: the rig's gyro_range, else
    the largest rate. horizon: s on the last log's clock, None: the rig's navigation, else the
    300 s after the test. block: s, None: complete segments.
    """

    model: str | None = None
    full_scale: float | None = None
    horizon: Span | None = None
    block: float | None = None
    earth_rate: Literal["compensate", "ignore"] = "compensate"


@dataclass(frozen=True, eq=False)
class ScaleTest(Result):
    """A scale factor test: its document, and the estimate in SI."""

    estimate: ScaleResult

    kind: ClassVar[str] = KIND

    def tables(self) -> "list[Table]":
        """Return summary, gyros and residuals."""
        return tables(self.document)

    def one_line_summary(self) -> str:
        """Return scale factor and nonlinearity in one line."""
        return one_line_summary(self.document)

    def figure(self) -> "Figure":
        """Return error and residuals over rate."""
        return plot.scale_figure(self.document, "result")


def scale_logs(
    runs: Sequence[TurnOn],
    options: ScaleOptions | None = None,
    progress: "Progress | None" = None,
) -> ScaleTest:
    """Return the scale factor test of several turn-ons of one IMU about one axis.

    Raises LogError where the rates do not allow it, RigError where figures are missing.
    """
    options = options or ScaleOptions()
    rig = runs[-1].rig
    noise, findings = gyro_noise(rig)
    base = fixed_base(rig) if options.earth_rate == "compensate" else None
    blocks, warnings = [], []
    for run in runs:
        reduced, found = reduce_turn_on(run, base, options.block, progress)
        blocks.append(reduced.gyro)
        warnings += found
    try:
        result = estimate_scale(
            tuple(blocks),
            noise,
            axis_name=rig.table.axis_name,
            axis=rig.table.axis,
            full_scale=options.full_scale or rig.imu.gyro_range,
            horizon=options.horizon or rig.stages.navigation,
            model=options.model,
        )
    except ValueError as error:
        raise LogError(runs[0].imu.path, f"{error}; add segments at other rates") from error
    result = replace(result, findings=(*findings, *with_path(result.findings, runs)))
    doc = laboratory_document(KIND, runs, to_fields(result), warnings, result.findings)
    return ScaleTest(doc, result)
