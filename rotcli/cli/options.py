"""The options that several commands share, each as a decorator."""

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

import click

from rotcli.cli.loading import note_max_bytes
from rotcli.cli.messages import note_verbose
from rotcli.cli.output import check_result_name
from rotcli.cli.values import Bytes, Finite, Window

Function = TypeVar("Function", bound=Callable[..., Any])

WINDOW = Window()
FINITE, NOT_NEGATIVE = Finite(), Finite(0.0)


def example(*commands: str) -> str:
    """Return the end of a command's help: commands that run one after the other as they stand."""
    return "\b\nExample:\n" + "\n".join(f"  {command}" for command in commands)


def rig(function: Function) -> Function:
    """Add `--rig`."""
    return click.option(
        "--rig",
        "rig_path",
        metavar="FILE",
        help="Description of the set-up [default: rig.toml beside the first log, if any].",
    )(function)


def messages(function: Function) -> Function:
    """Add `--quiet` and `--verbose`."""
    function = click.option(
        "-v",
        "--verbose",
        is_flag=True,
        expose_value=False,
        callback=note_verbose,
        help="Say on standard error what is done.",
    )(function)
    return click.option("--quiet", is_flag=True, help="No warnings, messages and progress.")(
        function
    )


def output(function: Function) -> Function:
    """Add `-o` for a result, `--quiet` and `--verbose`."""
    return output_as()(function)


def output_as(*tables: str) -> Callable[[Function], Function]:
    """Return what adds `-o` for a result, in JSON or as a table of these suffixes, and messages.

    With `--batch` -o is a folder. A name of any other suffix is a usage error.
    """

    def add(function: Function) -> Function:
        @wraps(function)
        def checked(**given: Any) -> Any:
            if not given.get("batch"):
                check_result_name(given["output"], tables)
            return function(**given)

        return click.option(
            "-o",
            "--output",
            metavar="FILE",
            help="Write the result here as JSON; - is standard output [default: a table].",
        )(messages(checked))  # type: ignore[return-value]

    return add


def max_bytes(function: Function) -> Function:
    """Add `--max-bytes`."""
    return click.option(
        "--max-bytes",
        type=Bytes(),
        expose_value=False,
        callback=note_max_bytes,
        help="What a log may hold at most, decompressed, such as 20G [default: 8G].",
    )(function)


def max_gap(function: Function) -> Function:
    """Add `--max-gap`."""
    return click.option(
        "--max-gap",
        metavar="SAMPLES",
        type=click.IntRange(min=0),
        default=5,
        show_default=True,
        help="Longest gap of the IMU log that is bridged.",
    )(function)
