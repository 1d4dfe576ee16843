"""Arrange the panels of a figure: margins from one measurement of labels, ticks and legends.

The space that labels and legends take next to their panel hardly depends on the panel's size. It is
measured once and the labels are pinned, so that drawing measures nothing again; matplotlib's
constrained layout measures four times, which is two thirds of the time of a small figure.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from rotcli.dataclass import dataclass
from rotcli.lazy import lazily

with lazily():
    from matplotlib import ticker

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PAD = 0.05  # inch, around everything
_GAP = 0.07  # inch, between rows and columns
_LABEL_PAD = 0.045  # inch, between tick labels and the axis' label
_FEW_LABELS = 100.0  # ratio of limits; less has one or two powers of ten
_POINTS = 72.0  # per inch


@dataclass
class _Sides:
    """Space next to a panel, inch; of tick labels alone where the name says so."""

    left_ticks: float
    left: float
    below_ticks: float
    below: float
    right: float
    above: float


def arrange(fig: "Figure") -> None:
    """Place the panels of a grid so that nothing is cut and nothing overlaps.

    Panels share the space that labels leave by the ratios of their grid; labels of a column of
    panels are aligned.
    """
    grid = [axes for axes in fig.axes if axes.get_subplotspec() is not None]
    if not grid:
        return
    for axes in grid:
        _label_log_axes(axes)
    renderer = fig.canvas.get_renderer()  # type: ignore[attr-defined]
    width, height = (float(v) for v in fig.get_size_inches())
    sides = {axes: _sides(axes, renderer, fig.dpi) for axes in grid}
    top, bottom = _outer(fig, renderer)
    spec: Any = grid[0].get_subplotspec().get_gridspec()  # type: ignore[union-attr]
    place = {axes: _span(axes) for axes in grid}

    def largest(count: int, value: Callable[[_Sides], float], line: int, end: int) -> list[float]:
        return [
            max([value(s) for a, s in sides.items() if place[a][line][end] == k], default=0.0)
            for k in range(count)
        ]

    left = largest(spec.ncols, lambda s: s.left, 1, 0)
    right = largest(spec.ncols, lambda s: s.right, 1, -1)
    above = largest(spec.nrows, lambda s: s.above, 0, 0)
    below = largest(spec.nrows, lambda s: s.below, 0, -1)
    ticks = largest(spec.ncols, lambda s: s.left_ticks, 1, 0)
    across = spec.get_width_ratios() or [1.0] * spec.ncols
    down = spec.get_height_ratios() or [1.0] * spec.nrows
    x = _shares(width - 2.0 * _PAD, left, right, across)
    y = _shares(height - 2.0 * _PAD - top - bottom, above, below, down)
    for axes in grid:
        rows, columns = place[axes]
        x0, x1 = _PAD + x[columns[0]][0], _PAD + x[columns[-1]][1]
        y1 = height - _PAD - top - y[rows[0]][0]
        y0 = height - _PAD - top - y[rows[-1]][1]
        axes.set_position((x0 / width, y0 / height, (x1 - x0) / width, (y1 - y0) / height))
        axes.yaxis.set_label_coords(-(ticks[columns[0]] + _LABEL_PAD) / (x1 - x0), 0.5)
        axes.xaxis.set_label_coords(0.5, -(sides[axes].below_ticks + _LABEL_PAD) / (y1 - y0))


def _label_log_axes(axes: "Axes") -> None:
    """Label a logarithmic axis of less than two decades at 1, 2 and 5 as well."""
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        if axis.get_scale() == "log" and low > 0.0 and high < _FEW_LABELS * low:
            axis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 5.0)))


def _span(axes: "Axes") -> tuple[Sequence[int], Sequence[int]]:
    """Return the rows and columns of the grid that a panel covers."""
    spec: Any = axes.get_subplotspec()
    return list(spec.rowspan), list(spec.colspan)


def _sides(axes: "Axes", renderer: Any, dpi: float) -> _Sides:
    """Return the space that a panel needs around itself, inch."""
    inner = axes.get_window_extent(renderer)
    tick = 3.5 / _POINTS
    left_ticks = below_ticks = tick
    right = above = 0.0
    left_box, below_box = _tick_labels(axes.yaxis, renderer), _tick_labels(axes.xaxis, renderer)
    if left_box is not None:
        left_ticks = max(tick, (inner.x0 - left_box.x0) / dpi)
        above = max(above, (left_box.y1 - inner.y1) / dpi)
    if below_box is not None:
        below_ticks = max(tick, (inner.y0 - below_box.y0) / dpi)
        right = max(right, (below_box.x1 - inner.x1) / dpi)
    left, below = left_ticks, below_ticks
    if axes.get_ylabel():
        left += _LABEL_PAD + axes.yaxis.label.get_window_extent(renderer).width / dpi
    if axes.get_xlabel():
        below += _LABEL_PAD + axes.xaxis.label.get_window_extent(renderer).height / dpi
    legend = axes.get_legend()
    boxes: list[Any] = [] if legend is None else [_legend_box(axes, left, renderer)]
    boxes += [child.get_tightbbox(renderer) for child in axes.child_axes]
    if axes.get_title():
        boxes.append(axes.title.get_window_extent(renderer))
    for box in boxes:
        above = max(above, (box.y1 - inner.y1) / dpi)
        right = max(right, (box.x1 - inner.x1) / dpi)
    return _Sides(left_ticks, left, below_ticks, below, right, above)


def _legend_box(axes: "Axes", left: float, renderer: Any) -> Any:
    """Return the box of a legend, in fewer columns where it is wider than the figure leaves."""
    legend: Any = axes.get_legend()
    fig: Any = axes.figure
    spec: Any = axes.get_subplotspec()
    width = fig.bbox.width / spec.get_gridspec().ncols - (left + 2.0 * _PAD) * fig.dpi
    box = legend.get_window_extent(renderer)
    for columns in (3, 2, 1):
        if box.width <= width:
            break
        legend = put_legend_above(axes, columns)
        box = legend.get_window_extent(renderer)
    return box


def put_legend_above(axes: "Axes", columns: int) -> Any:
    """Put the legend above the panel, where it covers no data; return it."""
    return axes.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        borderaxespad=0.1,
        borderpad=0.2,
    )


def _tick_labels(axis: Any, renderer: Any) -> Any:
    """Return the box of an axis' tick labels, None where it has none."""
    axis.set_label_coords(0.0, 0.0)  # a place of its own, which is not to be searched for
    shown = axis.label.get_visible()
    axis.label.set_visible(False)
    box = axis.get_tightbbox(renderer)
    axis.label.set_visible(shown)
    return box


def _outer(fig: "Figure", renderer: Any) -> tuple[float, float]:
    """Place title and source line; return the height that each takes, inch."""
    height = float(fig.get_size_inches()[1])
    taken = []
    for text, at_top in ((fig._suptitle, True), (fig._supxlabel, False)):  # type: ignore[attr-defined]
        if text is None:
            taken.append(0.0)
            continue
        text.set_y(1.0 - _PAD / height if at_top else _PAD / height)
        text.set_va("top" if at_top else "bottom")
        taken.append(text.get_window_extent(renderer).height / fig.dpi + _GAP)
    return taken[0], taken[1]


def _shares(
    length: float, before: Sequence[float], after: Sequence[float], ratios: Sequence[float]
) -> list[tuple[float, float]]:
    """Return start and end of each panel along one direction, inch from its beginning."""
    count = len(ratios)
    free = length - sum(before) - sum(after) - _GAP * (count - 1)
    free = max(free, 0.2 * length)  # labels of absurd length: panels stay visible
    unit = free / sum(ratios)
    places, at = [], 0.0
    for k in range(count):
        at += before[k]
        places.append((at, at + unit * ratios[k]))
        at += unit * ratios[k] + after[k] + _GAP
    return places
