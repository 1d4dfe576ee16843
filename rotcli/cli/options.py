"""Options that several commands share, each as a decorator, and their typed classes."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

import click

from rotcli.cli.loading import note_max_bytes
from rotcli.cli.messages import note_verbose
from rotcli.cli.output import check_result_name
from rotcli.cli.values import Bytes, Finite, Picture, Window
from rotcli.dataclass import dataclass
from rotcli.lazy import lazily

with lazily():
    from rotcli.files import figures
    from rotcli.files.results import find

Function = TypeVar("Function", bound=Callable[..., object])
Options = TypeVar("Options")
Span = tuple[float, float]  # start, end, s on the log's clock

STYLES = ("screen", "paper")  # of rotcli.files.figures, without loading it
WINDOW = Window()
FINITE, NOT_NEGATIVE = Finite(), Finite(0.0)


@dataclass(frozen=True)
class OutputOptions:
    """Options of every command with a result: `-o` and `--quiet`."""

    output: str | None
    quiet: bool


@dataclass(frozen=True)
class LogOptions(OutputOptions):
    """Options of every command that reads an IMU log with its rig."""

    imu_log: str
    rig_path: str | None


def collect(kind: type[Options]) -> Callable[[Callable[[Options], None]], Callable[..., None]]:
    """Return a decorator that passes the parameters of a command as one typed object.

    The fields of the frozen dataclass `kind` are the names of the parameters.
    """

    def decorate(function: Callable[[Options], None]) -> Callable[..., None]:
        @wraps(function)
        def command(**parameters: object) -> None:
            function(kind(**parameters))

        return command

    return decorate


def example(*commands: str) -> str:
    """Return the end of a command's help: commands that run one after the other."""
    return "\b\nExample:\n" + "\n".join(f"  {command}" for command in commands)


def logs(function: Function) -> Function:
    """Add the arguments IMU_LOG and TABLE_LOG, both optional for click."""
    function = click.argument("table_log", required=False)(function)
    return click.argument("imu_log", required=False)(function)


def rig(function: Function) -> Function:
    """Add `--rig`."""
    return click.option(
        "--rig",
        "rig_path",
        metavar="FILE",
        help="Set-up file [default: rig.toml in the folder of the first log, if present].",
    )(function)


def messages(function: Function) -> Function:
    """Add `--quiet` and `--verbose`."""
    function = click.option(
        "-v",
        "--verbose",
        is_flag=True,
        expose_value=False,
        callback=note_verbose,
        help="Print each step on standard error.",
    )(function)
    return click.option("--quiet", is_flag=True, help="No warnings, messages and progress.")(
        function
    )


def output(function: Function) -> Function:
    """Add `-o` for a result, `--quiet` and `--verbose`."""
    return output_as()(function)


def output_as(*tables: str) -> Callable[[Function], Function]:
    """Return a decorator that adds `-o` for a result, and messages.

    The result is JSON, or a table for a name with one of the suffixes `tables`; any other suffix
    is a usage error. With `--batch` -o is a folder.
    """

    def add(function: Function) -> Function:
        @wraps(function)
        def checked(**parameters: object) -> object:
            if not parameters.get("batch"):
                name = parameters["output"]
                check_result_name(None if name is None else str(name), tables)
            return function(**parameters)

        return click.option(
            "-o",
            "--output",
            metavar="FILE",
            help="Write the result as JSON to FILE, - is standard output [default: a table].",
        )(messages(checked))  # type: ignore[return-value]

    return add


def plot(content: str, remark: str = "") -> Callable[[Function], Function]:
    """Return a decorator that adds `--plot` and `--style`.

    content: of the figure, in words; remark: for the help. A name whose suffix is that of no
    picture is refused before the work begins.
    """

    def add(function: Function) -> Function:
        option = click.option(
            "--plot",
            type=Picture(),
            metavar="FILE",
            help=f"Draw {content} (.png, .svg, .pdf)" + (f"; {remark}." if remark else "."),
        )
        return option(figure_style(function))

    return add


def figure_style(function: Function) -> Function:
    """Add `--style`."""
    return click.option(
        "--style",
        type=click.Choice(STYLES),
        default="screen",
        show_default=True,
        expose_value=False,
        callback=_note_style,
        help="Figures for a screen, or for a paper: 3.5 or 7.2 inch wide, without titles.",
    )(function)


def _note_style(context: click.Context, parameter: click.Parameter, value: str) -> None:
    if value != STYLES[0]:
        figures.use_style(value)
        context.call_on_close(lambda: figures.use_style(STYLES[0]))


def calibrations(function: Function) -> Function:
    """Add `--calibration`, which may be repeated.

    The first file is the parameter `calibration` (None without any), the others are
    `more_calibrations`.
    """

    @wraps(function)
    def split(**parameters: object) -> object:
        paths = parameters["calibration"]
        assert isinstance(paths, tuple)
        paths = find.calibration_paths(paths) if paths else ()
        first = paths[0] if paths else None
        return function(**{**parameters, "calibration": first, "more_calibrations": paths[1:]})

    option = click.option(
        "--calibration",
        metavar="FILE|DIR|GLOB",
        multiple=True,
        help="Result of rotcli calibrate, triad, scale or thermal; repeat to apply several.",
    )
    return option(temperature(split))  # type: ignore[return-value]


def temperature(function: Function) -> Function:
    """Add `--temperature` and `--extrapolate` for calibrations over temperature and rate."""
    function = click.option(
        "--extrapolate",
        type=click.Choice(["clamp"]),
        help="Outside the range of a calibration use the value at its edge [default: an error].",
    )(function)
    return click.option(
        "--temperature",
        type=FINITE,
        metavar="DEG_C",
        help="Constant temperature for a thermal calibration [default: the log's column].",
    )(function)


def horizon(function: Function) -> Function:
    """Add `--horizon`, for results that predict the bias."""
    return click.option(
        "--horizon",
        type=WINDOW,
        help="Window of the predicted bias, s "
        "[default: the rig's navigation, else the next 300 s].",
    )(function)


def earth_rate(function: Function) -> Function:
    """Add `--earth-rate`."""
    return click.option(
        "--earth-rate",
        type=click.Choice(["compensate", "ignore"]),
        default="compensate",
        show_default=True,
        help="Compensate Earth rate, or ignore it as R16 does.",
    )(function)


def max_bytes(function: Function) -> Function:
    """Add `--max-bytes`."""
    return click.option(
        "--max-bytes",
        type=Bytes(),
        expose_value=False,
        callback=note_max_bytes,
        help="Maximum size of a log after decompression, for example 20G [default: 8G].",
    )(function)


def max_gap(function: Function) -> Function:
    """Add `--max-gap`."""
    return click.option(
        "--max-gap",
        metavar="SAMPLES",
        type=click.IntRange(min=0),
        default=5,
        show_default=True,
        help="Longest gap of the IMU log that is interpolated, in samples.",
    )(function)
