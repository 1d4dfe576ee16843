"""What several commands share: options, loading of logs and rig, and the way results go out."""

import math
import os
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import click

Function = TypeVar("Function", bound=Callable[..., Any])
Progress = Callable[[float], None]

_VERBOSE = "rotcli.verbose"
_MAX_BYTES = "rotcli.max_bytes"
_SOON = 1.0  # s; what takes less shows no bar


class Window(click.ParamType[tuple[float, float]]):
    """A stretch of a log, `START:END` in s on the log's own clock."""

    name = "START:END"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[float, float]:
        """Return (start, end)."""
        if isinstance(value, tuple):
            return value
        start, colon, end = str(value).partition(":")
        try:
            window = (float(start), float(end))
        except ValueError:
            window = (0.0, 0.0)
        if not colon or not window[0] < window[1] or not abs(window[1]) < float("inf"):
            self.fail(f"{value!r} is not START:END in seconds, start before end", param, ctx)
        return window


class Finite(click.ParamType[float]):
    """A finite number, not below `least`."""

    name = "number"

    def __init__(self, least: float = -math.inf) -> None:
        self.least = least

    def convert(self, value: Any, param: Any, ctx: Any) -> float:
        """Return the number."""
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if not self.least <= number < math.inf or number == -math.inf:
            at_least = f", {self.least:g} or more" if self.least > -math.inf else ""
            self.fail(f"{value!r} is not a finite number{at_least}", param, ctx)
        return number


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


def _note_verbose(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    ctx.meta[_VERBOSE] = value


def messages(function: Function) -> Function:
    """Add `--quiet` and `--verbose`."""
    function = click.option(
        "-v",
        "--verbose",
        is_flag=True,
        expose_value=False,
        callback=_note_verbose,
        help="Say on standard error what is done.",
    )(function)
    return click.option("--quiet", is_flag=True, help="No warnings, messages and progress.")(
        function
    )


def output(function: Function) -> Function:
    """Add `-o`, `--quiet` and `--verbose`."""
    function = messages(function)
    return click.option(
        "-o",
        "--output",
        metavar="FILE",
        help="Write the result here as JSON; - is standard output [default: a table].",
    )(function)


class Bytes(click.ParamType[int]):
    """A number of bytes, such as 500M or 20G."""

    name = "BYTES"

    def convert(self, value: Any, param: Any, ctx: Any) -> int:
        """Return the number."""
        text = str(value).strip().upper().removesuffix("B")
        power = "KMGT".find(text[-1:]) + 1 if text else 0
        try:
            count = float(text[:-1] if power else text) * 1000.0**power
        except ValueError:
            count = 0.0
        if not 1.0 <= count <= 1e18:
            self.fail(f"{value!r} is not a number of bytes such as 500M or 20G", param, ctx)
        return int(count)


def _note_max_bytes(ctx: click.Context, _: click.Parameter, value: int | None) -> None:
    ctx.meta[_MAX_BYTES] = value


def max_bytes(function: Function) -> Function:
    """Add `--max-bytes`."""
    return click.option(
        "--max-bytes",
        type=Bytes(),
        expose_value=False,
        callback=_note_max_bytes,
        help="What a log may hold at most, decompressed, such as 20G [default: 8G].",
    )(function)


def byte_limit() -> dict[str, Any]:
    """Return `max_bytes` as the readers take it, nothing where the option was not given."""
    ctx = click.get_current_context(silent=True)
    value = None if ctx is None else ctx.meta.get(_MAX_BYTES)
    return {} if value is None else {"max_bytes": value}


def check_outputs(
    inputs: Sequence[str | None], outputs: Mapping[str, str | None], log: str | None = None
) -> None:
    """Refuse, as a usage error, an output that would replace an input or another output.

    inputs: the files that are read; with a `log` also the rig.toml beside it. outputs: option to
    file, None and `-` for none.
    """
    read = [name for name in (log, *inputs) if name]
    read += [str(Path(log).with_name("rig.toml"))] if log and Path(log).name else []
    written: dict[str, str] = {}
    for option, name in outputs.items():
        if name is None or name == "-" or _is_special(name):
            continue
        for other in read:
            if _same_file(name, other):
                raise click.UsageError(f"{option} {name}: would replace the input {other}")
        for before, other in written.items():
            if _same_file(name, other):
                raise click.UsageError(f"{option} {name}: would replace what {before} writes")
        written[option] = name


def _is_special(name: str) -> bool:
    path = Path(name)
    return path.exists() and not path.is_file()


def _same_file(one: str, other: str) -> bool:
    try:
        return Path(one).samefile(other)
    except OSError:  # one of them is not there yet, or a link to itself
        return os.path.realpath(one) == os.path.realpath(other)


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


def load_rig(
    rig_path: str | None,
    first_log: str | None,
    changes: Mapping[str, Mapping[str, Any]] | None = None,
) -> Any:
    """Return the rig named, or the one beside the first log, or the default; options on top."""
    from rotcli.logs.rig import default_rig, read_rig

    if rig_path is None and first_log is not None:
        beside = Path(first_log).with_name("rig.toml")
        rig_path = str(beside) if beside.is_file() else None
    found = default_rig() if rig_path is None else read_rig(rig_path)
    tell(f"rig: {rig_path}" if rig_path else "no rig.toml: defaults")
    return lay_over(found, changes or {})


def load_logs(
    imu_log: str, table_log: str | None, rig: Any, max_gap: int | None, held: float = 1.0
) -> tuple[Any, Any]:
    """Return the IMU log, a long one not held, and the table log (None where there is none).

    held: times the usual length up to which a log is held.
    """
    from rotcli.logs.files import read_table
    from rotcli.logs.plausible import check_spans
    from rotcli.logs.stream import open_imu
    from rotcli.units import show_span

    limit = byte_limit()
    table = None if table_log is None else read_table(table_log, rig, imu_log=imu_log, **limit)
    with progress("reading") as told:
        imu = open_imu(
            imu_log, rig, max_gap=max_gap, table_log=table_log, progress=told, held=held, **limit
        )
    if table is not None:
        check_spans(table.path, table.time, table.interval, imu.time)
    for log in [log for log in (imu, table) if log is not None]:
        span = show_span(log.time[0], log.time[-1])
        tell(f"read {log.path}: {log.rows} records, {span}, {1.0 / log.interval:.6g} Hz")
    return imu, table


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


def rig_needs(rig: Any) -> str:
    """Return what a rig must go on saying of readings kept as they are; empty for nothing."""
    held = rig.effective().get("imu", {})
    needs = [f'sampling = "{rig.imu.sampling}"'] if rig.imu.sampling != "instant" else []
    turned = held.get("mount") not in (None, [[1, 0, 0], [0, 1, 0], [0, 0, 1]])
    needs += [f"mount = {_whole(held['mount'])}"] if turned else []
    return f"; its rig: [imu] {', '.join(needs)}" if needs else ""


def _whole(rows: Any) -> str:
    return "[" + ", ".join("[" + ", ".join(f"{n:g}" for n in row) + "]" for row in rows) + "]"


def lay_over(found: Any, changes: Mapping[str, Mapping[str, Any]]) -> Any:
    """Return the rig with the options that were given (not None) laid over it."""
    wanted = {
        section: {key: value for key, value in values.items() if value is not None}
        for section, values in changes.items()
    }
    wanted = {section: values for section, values in wanted.items() if values}
    from rotcli.errors import RigError

    try:
        return found.override(wanted) if wanted else found
    except RigError as fault:  # the rig itself was read before: an option is at fault
        text = str(fault).removeprefix(f"{found.path or 'rig'}: ")
        key = re.sub(r"^\[\w+\] (\w+)", lambda m: "--" + m[1].replace("_", "-"), text)
        raise click.UsageError(key) from fault


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


def write_series(path: str, columns: Mapping[str, Any]) -> None:
    """Write a time series to .parquet or .csv."""
    from rotcli.logs.write import write_columns

    write_columns(path, columns)
    tell(f"wrote {path}: {len(next(iter(columns.values())))} rows")


def write_parts(path: str, parts: Iterable[Mapping[str, Any]]) -> None:
    """Write a time series that comes part by part to .parquet or .csv."""
    from rotcli.logs.write import write_parts as write

    write(path, parts)


def deliver(
    docs: Any,
    table: Any,
    output: str | None,
    quiet: bool,
    headline: Callable[[Mapping[str, Any]], str] | None = None,
) -> None:
    """Print a table, or write result documents; warnings go to standard error either way.

    Several documents differ in their mode, which stands in the place of `{mode}` in the name.
    headline: a document in one line, told of each file written [default: the table's title].
    """
    from rotcli.results.files import write_result
    from rotcli.results.tables import to_text

    docs = docs if isinstance(docs, list) else [docs]
    warn([text for doc in docs for text in doc["warnings"]], quiet)
    if output is None:
        click.echo(to_text(table), nl=False)
        return
    for doc in docs:
        path = output.replace("{mode}", doc["mode"]) if "mode" in doc else output
        write_result(path, doc)
        tell(f"wrote {path}")
        if path != "-":
            warnings = len(doc["warnings"])
            told = f", {warnings} warning{'s' * (warnings > 1)}" if warnings else ""
            say(f"{path}: {headline(doc) if headline else table.title}{told}", quiet)


def axis(text: str | None) -> str | list[float] | None:
    """Return the value of `--axis` as a rig holds it: a letter or a list of three numbers."""
    return text if text is None or "," not in text else vector(text, "--axis")


def vector(text: str | None, option: str) -> list[float] | None:
    """Return three numbers from `X,Y,Z`; a usage error otherwise."""
    if text is None:
        return None
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 3:
        raise click.BadParameter(f"{text!r} is not three numbers X,Y,Z", param_hint=option)
    return numbers
