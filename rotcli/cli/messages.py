"""What a command says on standard error while it works: warnings, messages, a bar.

`--quiet` silences all of it, `--verbose` adds what is done. Nothing is said in a worker of a
batch, where no command runs.
"""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import click

Progress = Callable[[float], None]

_VERBOSE = "rotcli.verbose"
_SOON = 1.0  # s; what takes less shows no bar


def note_verbose(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    """Keep what `--verbose` says for `tell`; the option's callback."""
    ctx.meta[_VERBOSE] = value


def warn(warnings: Sequence[str], quiet: bool) -> None:
    """Print warnings on standard error, once each."""
    for text in [] if quiet else dict.fromkeys(warnings):
        click.echo(f"rotcli: warning: {text}", err=True)


def say(text: str, quiet: bool) -> None:
    """Print a message on standard error."""
    if not quiet:
        click.echo(f"rotcli: {text}", err=True)


def tell(text: str) -> None:
    """Print on standard error what is done, where --verbose asks for it."""
    ctx = click.get_current_context(silent=True)
    if ctx is not None and ctx.meta.get(_VERBOSE):
        click.echo(f"rotcli: {text}", err=True)


@contextmanager
def progress(label: str) -> Iterator[Progress | None]:
    """Give a function that is told how much (0 to 1) is done and draws a bar on a terminal.

    Gives None, so that nothing need be told, where no terminal looks on, --quiet is said, or no
    command is run (in a worker of a batch). What is done within a second shows no bar.
    """
    ctx = click.get_current_context(silent=True)
    if ctx is None or ctx.params.get("quiet") or not sys.stderr.isatty():
        yield None
        return
    start, bar = time.monotonic(), None

    def told(share: float) -> None:
        nonlocal bar
        if bar is None and time.monotonic() - start > _SOON:
            bar = click.progressbar(length=1000, label=label, file=sys.stderr, width=30)
            bar.__enter__()
        if bar is not None:
            bar.update(max(0, round(1000.0 * share) - bar.pos))

    try:
        yield told
    finally:
        if bar is not None:
            bar.__exit__(None, None, None)
