"""Messages on standard error: warnings, information, progress.

`--quiet` silences all of them; `--verbose` adds the steps, which the packages below log with
`logging`. A worker of a batch prints nothing, because no command runs there.
"""

import logging
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress

import click

from rotcli.cli.findings import with_option
from rotcli.files.text import visible

Progress = Callable[[float], None]

_MIN_PROGRESS_TIME = 1.0  # s; shorter work shows no bar


def note_verbose(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    """Print the log messages of rotcli on standard error; callback of `--verbose`."""
    logger = logging.getLogger("rotcli")
    if not value:
        return
    handler = _EchoHandler()
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    ctx.call_on_close(lambda: logger.removeHandler(handler))


def error_line(text: str) -> None:
    """Print a line on standard error; one that cannot be written costs nothing but itself."""
    with suppress(OSError):
        click.echo(visible(text), err=True)


class _EchoHandler(logging.Handler):
    """Print log messages the way click prints."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print one message."""
        error_line(f"rotcli: {record.getMessage()}")


def warn(warnings: Sequence[str], quiet: bool) -> None:
    """Print warnings on standard error, each once."""
    for text in [] if quiet else dict.fromkeys(warnings):
        error_line(f"rotcli: warning: {with_option(text)}")


def info(text: str, quiet: bool) -> None:
    """Print a message on standard error."""
    if not quiet:
        error_line(f"rotcli: {text}")


def verbose(text: str) -> None:
    """Print a step on standard error if `--verbose` is set."""
    logging.getLogger("rotcli.cli").info("%s", text)


@contextmanager
def progress(label: str) -> Iterator[Progress | None]:
    """Give a callback for the fraction done (0 to 1) that draws a bar on a terminal.

    Gives None without a terminal, with --quiet, or where no command runs (worker of a batch).
    Work shorter than a second shows no bar.
    """
    ctx = click.get_current_context(silent=True)
    if ctx is None or ctx.params.get("quiet") or not sys.stderr.isatty():
        yield None
        return
    start, bar = time.monotonic(), None

    def update(share: float) -> None:
        nonlocal bar
        if bar is None and time.monotonic() - start > _MIN_PROGRESS_TIME:
            bar = click.progressbar(length=1000, label=label, file=sys.stderr, width=30)
            bar.__enter__()
        if bar is not None:
            bar.update(max(0, round(1000.0 * share) - bar.pos))

    try:
        yield update
    finally:
        if bar is not None:
            bar.__exit__(None, None, None)
