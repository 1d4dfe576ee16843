"""`rotcli fleet`: repeatability, outliers, control charts, trend and yield over many results."""

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from rotcli.cli import messages, options
from rotcli.cli import output as outputs
from rotcli.dataclass import dataclass
from rotcli.errors import ResultError
from rotcli.files.text import visible
from rotcli.lazy import lazily

with lazily():
    from concurrent import futures

    import pandas as pd

    from rotcli.cli.batch import engines
    from rotcli.files import atomic
    from rotcli.files import spec as specifications
    from rotcli.files.results import documents, find
    from rotcli.files.tables import save
    from rotcli.files.tables import text as text_tables
    from rotcli.fleet import document, records, scan
    from rotcli.fleet import estimate as fleet_estimate
    from rotcli.fleet import page as fleet_page
    from rotcli.fleet import tables as fleet_tables

if TYPE_CHECKING:
    import pandas as pd

    from rotcli.files.spec import Spec
    from rotcli.fleet.estimate import FleetOptions, FleetResult
    from rotcli.fleet.scan import Chunk, Mapper

MANY_RESULTS = 20_000  # files; reading them takes seconds, of which processes save half
MAX_FAULT_LINES = 10  # files named one by one; the rest are counted


class Sigmas(click.ParamType):  # type: ignore[type-arg]
    """A default sigma: `PATTERN=VALUE` in the unit of the parameter."""

    name = "NAME=VALUE"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, float]:
        """Return the pattern of names and the sigma."""
        name, sign, number = str(value).partition("=")
        try:
            sigma = float(number)
        except ValueError:
            sigma = 0.0
        if not sign or not name or not 0.0 < sigma < float("inf"):
            self.fail(f"{value!r} is not a name, '=' and a positive number", param, ctx)
        return name, sigma


@dataclass(frozen=True)
class FleetFiles:
    """Files that the command writes; None for those not requested."""

    output: str | None
    page: str | None
    table: str | None
    dataset: str | None


@click.command(
    epilog=options.example(
        "rotcli simulate --fleet 20,8,4 --seed 1 -o fleet",
        "rotcli fleet fleet -o fleet/fleet.json --page fleet/fleet.html",
    )
)
@click.argument("sources", nargs=-1, required=True, metavar="RESULT|DIR|GLOB|DATASET…")
@click.option("--spec", "spec_path", metavar="FILE", help="Limits of the parameters (TOML).")
@click.option(
    "--parameter",
    "parameters",
    multiple=True,
    metavar="NAME",
    help="Analyse these parameters only, such as bias_z or 'bias_*' [default: all].",
)
@click.option(
    "--default-sigma",
    "sigmas",
    type=Sigmas(),
    multiple=True,
    help="Sigma of values without one, such as 'bias_*=5'; without it they are excluded.",
)
@click.option(
    "--baseline",
    type=click.IntRange(2),
    default=5,
    show_default=True,
    help="Points of a control chart that make its mean.",
)
@click.option("--page", metavar="FILE.html", help="Write a page with charts.")
@click.option("--table", metavar="FILE", help="Write one row per value (.csv or .parquet).")
@click.option(
    "--dataset",
    metavar="DIR",
    help="Append new results (by their SHA-256) to this Parquet data set, and analyse all of it.",
)
@click.option(
    "--scheduler",
    metavar="ADDRESS|processes",
    help="Read the results on a Dask cluster (tcp://HOST:PORT) or in processes of this machine "
    "(20,000 results or more always are).",
)
@click.option("--title", default="Fleet", show_default=True, help="Heading of the page.")
@options.output
def command(
    sources: tuple[str, ...],
    spec_path: str | None,
    parameters: tuple[str, ...],
    sigmas: tuple[tuple[str, float], ...],
    baseline: int,
    page: str | None,
    table: str | None,
    dataset: str | None,
    scheduler: str | None,
    title: str,
    output: str | None,
    quiet: bool,
) -> None:
    """Analyse many results: repeatability, outliers, control charts, trend and yield.

    Every value enters with its sigma. Units are those of [unit] serial or [imu] name, days those
    of [unit] date or of a dated folder; the spec file can name them by folder.
    """
    _check_names(page, table)
    outputs.check_outputs([*sources, spec_path], {"-o": output, "--page": page, "--table": table})

    spec = None if spec_path is None else specifications.read_spec(spec_path)
    chosen = fleet_estimate.FleetOptions(dict(sigmas), baseline, parameters)
    files = FleetFiles(output, page, table, dataset)
    frame, inputs = _gather(sources, spec, dataset, scheduler, quiet)
    _analyse(frame, inputs, chosen, spec, files, title, quiet)


def _check_names(page: str | None, table: str | None) -> None:
    if page is not None and not page.lower().endswith((".html", ".htm")):
        raise click.UsageError(f"--page {page}: a page is HTML; name it .html")
    if table is not None and Path(table).suffix.lower() not in (".csv", ".parquet"):
        raise click.UsageError(f"--table {table}: name it .csv or .parquet")


def _gather(
    sources: Sequence[str],
    spec: "Spec | None",
    dataset: str | None,
    scheduler: str | None,
    quiet: bool,
) -> "tuple[pd.DataFrame, list[dict[str, object]]]":
    """Return the table of all sources and one entry per source for the document."""
    stored = [s for s in sources if scan.is_dataset(s)]
    if dataset is not None and scan.is_dataset(dataset) and dataset not in stored:
        stored.append(dataset)
    frames = [scan.read_dataset(path) for path in stored]
    known = frozenset(sha for frame in frames for sha in frame["sha256"])
    folders = records.Folders(None if spec is None else spec.folders)
    loose = [s for s in sources if s not in stored]
    paths, named = find.find_results(loose)
    found = [*paths, *named]
    many = len(found) >= MANY_RESULTS
    try:
        with _Mapping("processes" if scheduler is None and many else scheduler) as mapper:
            chunk = scan.read_results(found, folders, known, mapper)
    except futures.BrokenExecutor:
        messages.warn(["a reading process was killed; this one reads all results"], quiet)
        chunk = scan.read_results(found, folders, known)
    _warn_faults(chunk, named, quiet)
    new, copies = scan.to_frame(chunk)
    if copies:
        what = "file is a copy" if copies == 1 else "files are copies"
        messages.warn([f"{copies} {what} of another result; each counts once"], quiet)
    if dataset is not None:
        added = scan.append_dataset(dataset, new)
        messages.info(f"{dataset}: {added} new results, {chunk.skipped} files skipped", quiet)
    frame = pd.concat([*frames, new], ignore_index=True) if frames else new
    frame = frame.drop_duplicates(["sha256", "parameter"], ignore_index=True)
    return frame, _inputs(frame, [*loose, *stored])


def _warn_faults(chunk: "Chunk", named: Sequence[str], quiet: bool) -> None:
    """Warn about files of a folder that are not valid; raise for one that was named itself."""
    for fault in chunk.faults:
        if any(fault.startswith(f"{path}: ") for path in named):
            raise ResultError(fault)
    lines = [f"{fault}. The file is skipped" for fault in chunk.faults[:MAX_FAULT_LINES]]
    more = len(chunk.faults) - MAX_FAULT_LINES
    if more > 0:
        lines.append(f"{more} more files are not valid and skipped")
    messages.warn(lines, quiet)


def _inputs(frame: "pd.DataFrame", sources: Iterable[str]) -> "list[dict[str, object]]":
    """Return the provenance: the sources, the number of results, the hash of their hashes."""
    hashes = sorted(frame["sha256"].unique().tolist())
    digest = hashlib.sha256("".join(hashes).encode()).hexdigest()
    return [{"path": ", ".join(sources), "results": len(hashes), "sha256": digest}]


class _Mapping:
    """The map function of this process, of a pool of processes, or of a Dask cluster."""

    def __init__(self, scheduler: str | None) -> None:
        self._scheduler = scheduler
        self._close: list[object] = []

    def __enter__(self) -> "Mapper":
        if self._scheduler is None:
            return map
        if self._scheduler == "processes":
            pool = futures.ProcessPoolExecutor()
            self._close.append(pool)
            return pool.map
        return self._cluster(self._scheduler)

    def _cluster(self, address: str) -> "Mapper":
        client = engines.connect(address)
        self._close.append(client)
        return lambda task, chunks: client.gather(client.map(task, list(chunks), pure=False))

    def __exit__(self, *_: object) -> None:
        for engine in self._close:
            stop = getattr(engine, "shutdown" if self._scheduler == "processes" else "close")
            stop()


def _analyse(
    frame: "pd.DataFrame",
    inputs: "list[dict[str, object]]",
    chosen: "FleetOptions",
    spec: "Spec | None",
    files: FleetFiles,
    title: str,
    quiet: bool,
) -> None:
    result = fleet_estimate.estimate(frame, chosen, spec)
    doc = document.to_document(result, inputs)
    messages.warn(doc["warnings"], quiet)
    if files.output is None:
        click.echo(
            "\n".join(
                text_tables.to_text(made, outputs.terminal_width())
                for made in fleet_tables.tables(doc)
            ),
            nl=False,
        )
    else:
        documents.write_result(files.output, doc)
        if files.output != "-":
            messages.info(f"{files.output}: {fleet_tables.one_line_summary(doc)}", quiet)
    if files.page is not None:
        documents.write_text(files.page, visible(fleet_page.to_html_page(result, doc, title)))
        messages.info(f"{files.page}: page of {len(result.parameters)} parameters", quiet)
    if files.table is not None:
        _write_table(files.table, result, quiet)


def _write_table(path: str, result: "FleetResult", quiet: bool) -> None:
    frame = document.tidy(result)
    try:
        with atomic.atomic_write(path) as stream:
            if path.lower().endswith(".csv"):
                stream.write(save.csv_text(frame).encode())
            else:
                frame.to_parquet(stream, index=False)
    except OSError as fault:
        raise documents.write_error(path, fault) from fault
    messages.info(f"{path}: {len(frame)} values", quiet)
