"""How every figure looks and is saved.

One style for all: colours of Okabe and Ito, which colour-blind readers can distinguish, and a line
style and marker for each, so that a grey print is readable too. Legends are above their
panel and cover nothing. The user's matplotlib settings are left out and no date is written: the
same figure gives the same bytes. matplotlib is imported on use, and pyplot never.
"""

import contextlib
import html
import importlib.util
import io
import logging
import os
import re
import sys
import textwrap
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.files.atomic import atomic_write
from rotcli.files.figure_layout import arrange, put_legend_above
from rotcli.files.results.documents import write_error
from rotcli.lazy import lazily

with lazily():
    import matplotlib
    from matplotlib import figure, ticker
    from matplotlib.backends import backend_agg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Drawing = tuple[str, Callable[[], Figure]]  # title, function that draws


FORMATS = {".png": "png", ".svg": "svg", ".pdf": "pdf"}
# What would tie the bytes to the hour or the version of matplotlib.
_NO_METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None, "Format": None, "Type": None},
    "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
}
WIDTH = 4.8  # inch: a column of a page, readable on a phone


@dataclass(frozen=True)
class Style:
    """How figures are made for a screen or a paper.

    single, double: widths, inch, of one column of panels and of several; double is per column for
    a screen. height: of a panel against that of the screen. titled: title and file name inside.
    """

    single: float
    double: float
    height: float
    titled: bool
    settings: Mapping[Any, Any]


_MARKS = 5  # intervals of a vertical axis
INK, FAINT, SOFT = "#222222", "#595959", "#d9d9d9"
# Okabe and Ito (2008), the darker ones, with the line and marker that go with each.
BLUE: dict[str, Any] = {"color": "#0072B2", "linestyle": "-", "marker": "o"}
VERMILLION: dict[str, Any] = {"color": "#D55E00", "linestyle": "--", "marker": "s"}
GREEN: dict[str, Any] = {"color": "#009E73", "linestyle": "-.", "marker": "^"}
PINK: dict[str, Any] = {"color": "#CC79A7", "linestyle": ":", "marker": "D"}
SKY: dict[str, Any] = {"color": "#56B4E9", "linestyle": (0, (6, 1, 1, 1, 1, 1)), "marker": "v"}
SERIES = (BLUE, VERMILLION, GREEN)
MANY = (*SERIES, PINK, SKY)

_FONT = "DejaVu Sans"  # part of matplotlib: the same letters everywhere
_STYLE: dict[Any, Any] = {
    "font.family": _FONT,  # one: a search through a family of ten costs a tenth of a figure
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.5,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": SOFT,
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.4,
    "lines.markersize": 4.5,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "legend.columnspacing": 1.4,
    "errorbar.capsize": 2.5,
    "hatch.linewidth": 0.6,
    "savefig.dpi": 200,
    "pdf.fonttype": 42,
    "svg.hashsalt": "rotcli",
    "svg.fonttype": "none",  # text stays text, and its font is not in every file
    "axes.formatter.useoffset": False,
}
# Column widths of journals: 3.5 inch, and 7.2 inch across the page; letters of 8 pt.
STYLES = {
    "screen": Style(WIDTH, 2.0 * WIDTH, 1.0, titled=True, settings={}),
    "paper": Style(
        3.5,
        7.2,
        0.78,
        titled=False,
        settings={
            "font.size": 8.0,
            "axes.labelsize": 8.0,
            "axes.titlesize": 8.0,
            "legend.fontsize": 7.0,
            "xtick.labelsize": 7.0,
            "ytick.labelsize": 7.0,
            "lines.linewidth": 1.1,
            "lines.markersize": 3.5,
            "axes.linewidth": 0.6,
            "grid.linewidth": 0.4,
            "legend.handlelength": 2.2,
            "legend.columnspacing": 1.0,
            "legend.handletextpad": 0.5,
            "savefig.dpi": 600,
        },
    ),
}
_active: ContextVar[Style | None] = ContextVar("active style", default=None)
_style: ContextVar[Style] = ContextVar("style", default=STYLES["screen"])


def use_style(name: str) -> None:
    """Make all figures from now on in a style of STYLES: `screen` or `paper`."""
    _style.set(STYLES[name])


@contextmanager
def styled() -> Iterator[None]:
    """Draw in the project's style, whatever the user's matplotlibrc says; works as decorator.

    Within another such block it changes nothing: checking all settings costs as much as a panel.
    """
    style = _style.get()
    if _active.get() is style:
        yield
        return
    if "matplotlib" not in sys.modules:
        _import_matplotlib()
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        matplotlib.rcParams.update(style.settings)
        token = _active.set(style)
        try:
            yield
        finally:
            _active.reset(token)


def _working_directory_exists() -> bool:
    try:
        return bool(Path.cwd())
    except FileNotFoundError:
        return False


def _import_matplotlib() -> None:
    """Import matplotlib with its own settings.

    It would read a file `matplotlibrc` of the working directory, the folder of the data: a broken
    one ends the import, a pipe blocks it. In the folder of its own settings it finds those. No
    backend is used; a wrong name in MPLBACKEND would end the import.
    """
    os.environ.pop("MPLBACKEND", None)
    spec = importlib.util.find_spec("matplotlib")
    places = list(spec.submodule_search_locations or ()) if spec else []
    logger = logging.getLogger("matplotlib")
    level = logger.level
    logger.setLevel(logging.ERROR)  # where it keeps its cache is no matter of a log
    try:
        inside = places and _working_directory_exists()
        with contextlib.chdir(Path(places[0]) / "mpl-data") if inside else nullcontext():
            importlib.import_module("matplotlib").get_cachedir()
    finally:
        logger.setLevel(level)


def figure_format(path: str) -> str:
    """Return the format that a file name asks for; raises ResultError naming the known ones."""
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise ResultError(f"{path}: unknown kind of picture '{suffix}'; name it .png, .svg or .pdf")
    return FORMATS[suffix]


def save_figure(fig: "Figure", path: str) -> None:
    """Write a figure as PNG, SVG or PDF by its suffix, by an atomic write.

    Raises ResultError for another suffix or a file that cannot be written.
    """
    data = figure_bytes(fig, figure_format(path))
    try:
        with atomic_write(path) as stream:
            stream.write(data)
    except OSError as fault:
        raise write_error(path, fault) from fault


@styled()
def arranged(fig: "Figure") -> "Figure":
    """Return the figure with its panels in place, for a program that shows it itself."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # a name in another script
        arrange(fig)
    return fig


@styled()
def figure_bytes(fig: "Figure", kind: str) -> bytes:
    """Return a figure as the bytes of a `png`, `svg` or `pdf` file, the same every time."""
    stream = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # a name in another script
        arrange(fig)
        fig.savefig(stream, format=kind, metadata=_NO_METADATA[kind])
    data = stream.getvalue()
    if kind == "svg":  # for readers without the font: one as wide
        data = data.replace(f"'{_FONT}'".encode(), f"'{_FONT}', Verdana, sans-serif".encode())
    return data


def inline_svg(prefix: str, title: str, figure: "Figure") -> str:
    """Return a figure as an `svg` element for a page; `prefix` makes its ids unique there."""
    text = figure_bytes(figure, "svg").decode()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", text, flags=re.DOTALL)
    opening, rest = text.split(">", 1)
    box = re.search(r'viewBox="([^"]+)"', opening)
    assert box is not None  # matplotlib always writes one
    rest = re.sub(r'\bid="', f'id="{prefix}-', rest)
    rest = re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{prefix}-", rest).replace("xlink:href", "href")
    rest = re.sub(r"\n\s*", "\n", rest)
    # The style that matplotlib puts into each figure would apply to the complete page.
    rest = re.sub(r"<style.*?</style>", "", rest, flags=re.DOTALL)
    return (
        f'<svg class="plot" role="img" aria-label="{html.escape(title)}" viewBox="{box[1]}">{rest}'
    )


def panels(
    count: int,
    height: float,
    title: str,
    *,
    share: bool = True,
    columns: int = 1,
    ratios: Sequence[float] | None = None,
    source: str = "",
    width: float | None = None,
) -> "tuple[Figure, Any]":
    """Return a figure of `count` panels one above the other, each `height` inch, and its axes.

    title: above the panels; source: small below them, such as the log; long ones in lines.
    columns: several such rows of panels side by side: the axes are then (count, columns).
    ratios: heights of the panels against each other. width: inch, on a screen.
    """
    style = _style.get()
    if width is None or not style.titled:
        width = style.double * (0.5 * columns if style.titled else 1.0)
        width = style.single if columns == 1 else width
    size = (width, style.height * (0.5 + count * height))
    fig = figure.Figure(figsize=size)
    backend_agg.FigureCanvasAgg(fig)
    axes = fig.subplots(count, columns, sharex=share, squeeze=False, height_ratios=ratios)
    for panel in axes.flat:  # few marks: each costs as much as a line
        panel.yaxis.set_major_locator(ticker.MaxNLocator(_MARKS, steps=(1, 2, 5, 10)))
    if columns == 1:
        axes = axes[:, 0]
    if not style.titled:
        return fig, axes
    if title:
        fig.suptitle(_lines(title, 44 * columns), fontsize=10.5, fontweight="bold")
    if source:
        fig.supxlabel(_lines(source, 72 * columns), fontsize=7.5, color=FAINT)
    return fig, axes


def plain(text: str) -> str:
    """Return the text as matplotlib shows it letter by letter, no dollar sign read as formula.

    What cannot be printed, such as a line feed in the name of a file, is shown as a question mark.
    """
    return "".join(c if c.isprintable() else "?" for c in text).replace("$", r"\$")


def _lines(text: str, width: int) -> str:
    """Return a text as it is drawn, in lines of about `width` characters."""
    return "\n".join(plain(line) for line in textwrap.wrap(text, width, break_on_hyphens=False))


def legend_above(axes: "Axes", columns: int) -> None:
    """Put the legend above the panel, where it covers no data."""
    put_legend_above(axes, columns)


def is_titled() -> bool:
    """Return whether figures contain titles, sources and explanations: those of a screen do."""
    return _style.get().titled


def log_axes(axes: "Axes", *, x: bool = False, y: bool = True) -> None:
    """Make axes logarithmic, labels plain numbers such as 0.01 and 1000.

    On a screen without marks between the powers of ten: drawing each costs as much as a line.
    """
    chosen: list[tuple[Any, Any]] = [(axes.set_xscale, axes.xaxis)] if x else []
    chosen += [(axes.set_yscale, axes.yaxis)] if y else []
    for scale, axis in chosen:
        scale("log")
        axis.set_major_formatter(ticker.FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(ticker.NullFormatter())
        if _style.get().titled:
            axis.set_minor_locator(ticker.NullLocator())
