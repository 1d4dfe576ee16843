"""The figure of a plan: the navigation error to expect, against time and against rate."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from rotcli.errors import ResultError
from rotcli.files import captions
from rotcli.files.figures import panels, styled
from rotcli.files.results.expected_runs import draw_over_rate, draw_over_time, drawn_runs

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@styled()
def plan_figure(doc: Mapping[str, Any]) -> "Figure":
    """Draw the expected errors of a plan document; raises ResultError where there are none."""
    expected = doc["expected"]
    runs = drawn_runs(expected)
    if not runs:
        reason = expected["reason"] or next(run["reason"] for run in expected["runs"])
        raise ResultError(f"no expected errors to draw: {reason}", code="no-noise-figures")
    title = captions.title_without_imu(doc, "expected navigation errors")
    fig, axes = panels(2, 2.8, title, share=False)
    draw_over_time(axes[0], expected["rate_dps"], runs)
    draw_over_rate(axes[1], expected["duration_s"], runs)
    fig.align_ylabels()
    return fig
