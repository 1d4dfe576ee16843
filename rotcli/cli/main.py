"""The `rotcli` command: a group that imports the module of a command on use.

The only place where expected errors become one line and an exit status: 0 done, 1 error in data or
files, 2 error in the command line, 130 interrupted, 141 the reader of a pipe has gone.
"""

import importlib
import io
import os
import sys
from contextlib import suppress
from typing import NoReturn

import click

from rotcli.cli.findings import with_option
from rotcli.cli.messages import error_line
from rotcli.errors import RotcliError
from rotcli.files.names import suggest
from rotcli.version import __version__

# Heading of the list of commands: name: module below rotcli.cli, summary. Kept here so that the
# list needs no import of the commands; the function in each module is `command`.
GROUPS: dict[str, dict[str, tuple[str, str]]] = {
    "Look at logs": {
        "inspect": ("look.inspect", "Show what a log is, its problems and the rig lines for them."),
        "convert": ("look.convert", "Convert an IMU log into plain Parquet or CSV."),
        "correct": ("look.correct", "Write an IMU log with calibrations applied."),
        "help": ("look.help", "Print a reference page: rig, results or checks."),
    },
    "Test sensors": {
        "allan": (
            "measure.allan",
            "Measure the noise of a still log: Allan deviation, coefficients, Gauss-Markov.",
        ),
        "calibrate": (
            "measure.calibrate",
            "Estimate gyro biases, scale factor and installation errors from a log.",
        ),
        "triad": (
            "measure.triad",
            "Calibrate both triads on a table of one to three axes, or by hand.",
        ),
        "scale": (
            "measure.scale",
            "Measure scale factor, asymmetry, nonlinearity and hysteresis over rates.",
        ),
        "thermal": (
            "measure.thermal",
            "Measure bias and scale factor over temperature, lag and warm-up.",
        ),
    },
    "Navigate": {
        "navigate": (
            "navigation.navigate",
            "Run inertial navigation on a log and report the errors relative to the fixed base.",
        ),
        "observe": (
            "navigation.observe",
            "Show which error states a motion makes observable, and estimate them from a log.",
        ),
        "srins": (
            "navigation.srins",
            "Simulate, calibrate and observe a single-axis rotation INS.",
        ),
    },
    "Plan": {
        "plan": (
            "planning.plan",
            "Plan the positions and spins that calibrate both triads best in a given time.",
        ),
        "budget": (
            "planning.budget",
            "Predict the error after one turn per axis and source, and recommend an axis.",
        ),
        "simulate": (
            "planning.simulate",
            "Simulate the logs of an IMU on a still or turning table, with true values.",
        ),
    },
    "Pass results on": {
        "report": ("sharing.report", "Combine result files into tables or an HTML page."),
        "certificate": (
            "sharing.certificate",
            "Write one A4 page per device, with verdicts against a specification.",
        ),
        "fleet": (
            "sharing.fleet",
            "Analyse many results: repeatability, outliers, control charts, trend, yield.",
        ),
        "export": (
            "sharing.export",
            "Write figures for Kalibr, OpenVINS, VINS, ROS, PX4, ArduPilot, MATLAB and others.",
        ),
    },
}
COMMANDS = {name: entry for group in GROUPS.values() for name, entry in group.items()}


class _Stopped(Exception):  # noqa: N818 (no error)
    """A command was stopped from outside: the reader went away, or an interrupt."""

    def __init__(self, status: int) -> None:
        self.status = status


class LazyGroup(click.Group):
    """A group of commands, each in its own module, imported on use."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names in the order of COMMANDS."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return a command, or None for a name that is none."""
        if cmd_name not in COMMANDS:
            return None
        module = importlib.import_module(f"rotcli.cli.{COMMANDS[cmd_name][0]}")
        command: click.Command = module.command
        return command

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: object,
    ) -> click.Context:
        """Take the command line apart; what `--help` prints may find no reader, too.

        Raises _Stopped.
        """
        try:
            return super().make_context(info_name, args, parent, **extra)
        except BrokenPipeError as error:
            raise _Stopped(141) from error

    def invoke(self, ctx: click.Context) -> object:
        """Run a command; click's own way with broken pipes and interrupts is status 1, two lines.

        Raises _Stopped.
        """
        try:
            return super().invoke(ctx)
        except BrokenPipeError as error:
            raise _Stopped(141) from error
        except KeyboardInterrupt as error:
            raise _Stopped(130) from error

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command; an unknown name names the similar one."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            ctx.fail(f"no such command '{args[0]}'; {suggest(args[0], COMMANDS)}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands without importing them."""
        for heading, commands in GROUPS.items():
            with formatter.section(heading):
                formatter.write_dl([(name, text) for name, (_, text) in commands.items()])


@click.group(
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="\b\nExample:\n  rotcli simulate --imu nav440 --rate 10 --seed 1 -o run\n"
    "  rotcli calibrate run/imu.parquet run/table.parquet -o run/calibration.json",
)
@click.version_option(__version__, prog_name="rotcli")
def cli() -> None:
    """Turntable logs of an IMU: noise, calibration, rotary navigation, observability.

    `rotcli COMMAND --help` explains a command and shows one that runs.
    """


def main(args: list[str] | None = None) -> NoReturn:
    """Run the command line and exit with its status."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a name that the terminal cannot show
            stream.reconfigure(errors="backslashreplace")
    try:
        cli.main(args=args, prog_name="rotcli", standalone_mode=False)
        sys.stdout.flush()
    except RotcliError as error:
        error_line(f"rotcli: error: {' '.join(with_option(error).split())}")
        sys.exit(1)
    except click.exceptions.Exit as stop:
        sys.exit(stop.exit_code)
    except click.ClickException as error:
        with suppress(OSError):  # as `error_line`: a full disk does not change the status
            error.show()
        sys.exit(error.exit_code)
    except (click.Abort, KeyboardInterrupt, BrokenPipeError, _Stopped) as stop:
        gone = isinstance(stop, BrokenPipeError) or getattr(stop, "status", 130) == 141
        if gone:  # `| head`
            _drop_output()
            sys.exit(141)
        error_line("rotcli: interrupted; no partial files remain")
        sys.exit(130)
    except OSError as error:  # of standard output; those of files are reported where they happen
        where = error.filename or "standard output"
        what = f"{error.strerror or error}; make room, or write elsewhere"
        error_line(f"rotcli: error: {where}: cannot be written: {what}")
        _drop_output()
        sys.exit(1)
    sys.exit(0)


def _drop_output() -> None:
    """Give the interpreter nothing left to flush."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
