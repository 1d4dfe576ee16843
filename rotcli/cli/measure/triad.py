"""`rotcli triad`: full calibration on a table of one to three axes, or by hand."""

from typing import TYPE_CHECKING, Any

import click

from rotcli.cli import loading, messages, options
from rotcli.cli import output as delivery

if TYPE_CHECKING:
    from rotcli.triad.result import TriadResult

CONVENTIONS = ("auto", "table", "accelerometer", "z-accelerometer", "symmetric")
GROUP_NAMES = ("N", "d", "G", "Ag", "M", "b", "K2", "Aa", "R", "eps", "table", "tau", "g")


class Groups(click.ParamType[str]):
    """Groups of parameters: a comma-separated list."""

    name = "N,d,…"

    def convert(self, value: Any, param: Any, ctx: Any) -> str:
        """Return the groups with blanks between them."""
        names = [part.strip() for part in str(value).replace(" ", ",").split(",") if part.strip()]
        wrong = [name for name in names if name not in GROUP_NAMES]
        if wrong or not names:
            known = ", ".join(GROUP_NAMES)
            self.fail(f"{wrong[0] if wrong else value!r} must be one of {known}", param, ctx)
        return " ".join(names)


@click.command(
    epilog=options.example(
        "rotcli simulate --sequence M5 --imu nav440 --seed 1 -o run",
        "rotcli triad run/imu.parquet run/table.parquet -o run/triad.json",
    )
)
@click.argument("logs", nargs=-1, metavar="IMU_LOG [TABLE_LOG]")
@options.rig
@click.option(
    "--merge",
    is_flag=True,
    help="The arguments are results of rotcli calibrate about three axes; merge them into one.",
)
@click.option(
    "--parameters",
    type=Groups(),
    help="Groups to estimate: N d G Ag M b K2 Aa R eps table tau g [default: all but Ag, Aa].",
)
@click.option("--asymmetry", is_flag=True, help="Estimate the asymmetries Ag and Aa as well.")
@click.option(
    "--convention",
    type=click.Choice(CONVENTIONS),
    default="auto",
    show_default=True,
    help="Sensor frame: the table's, or fixed by the accelerometers (Kalibr, PSINS; "
    "z-accelerometer: imu_tk).",
)
@click.option("--no-drift", is_flag=True, help="Constant biases, whatever the rig's noise says.")
@click.option("--residuals", metavar="FILE", help="Write the residuals (.csv or .parquet).")
@click.option("--plot", metavar="FILE", help="Draw residuals before and after (png, svg, pdf).")
@options.max_gap
@options.max_bytes
@options.output
def command(
    logs: tuple[str, ...],
    rig_path: str | None,
    merge: bool,
    parameters: str | None,
    asymmetry: bool,
    convention: str,
    no_drift: bool,
    residuals: str | None,
    plot: str | None,
    max_gap: int | None,
    output: str | None,
    quiet: bool,
) -> None:
    """Calibrate gyros and accelerometers: scale, installation, bias, g-sensitivity and more.

    With TABLE_LOG the angles of one to three table axes; ramps and slews are data. Without it the
    IMU was moved by hand through at least twelve still poses.
    """
    _check_arguments(logs, merge)
    outputs = {"-o": output, "--residuals": residuals, "--plot": plot}
    delivery.check_outputs([*logs[1:], rig_path], outputs, log=logs[0])
    if merge:
        result, doc = _merged(logs)
    else:
        from rotcli.models.triad import parameters as names
        from rotcli.triad.table_run import TriadOptions

        groups = parameters or (names.WITH_ASYMMETRY if asymmetry else names.BASIC)
        chosen = TriadOptions(groups, convention, drift=not no_drift)
        result, doc = _calibrated(logs, rig_path, chosen, max_gap)
    if residuals and result.series:
        delivery.write_time_series(residuals, result.series)
    if plot and result.series:
        from rotcli.files.figures import save_figure
        from rotcli.triad.plot import residual_figure

        save_figure(residual_figure(result, doc), plot)
    _deliver(doc, output, quiet)


def _check_arguments(logs: tuple[str, ...], merge: bool) -> None:
    """Raise UsageError for a wrong number of arguments."""
    if merge and len(logs) < 3:
        raise click.UsageError("--merge needs three results of rotcli calibrate")
    if not merge and not 1 <= len(logs) <= 2:
        raise click.UsageError("give IMU_LOG and, where there is a table, TABLE_LOG")


def _calibrated(
    logs: tuple[str, ...], rig_path: str | None, chosen: Any, max_gap: int | None
) -> tuple["TriadResult", dict[str, Any]]:
    """Calibrate from logs; return the result and its document."""
    from rotcli.files.documents import Log, document
    from rotcli.run.correction import KIND
    from rotcli.triad.document import fields

    rig = loading.load_rig(rig_path, logs[0])
    table = None
    if len(logs) > 1:
        from rotcli.logs.table_axes import read_table_axes

        table = read_table_axes(logs[1], rig, imu_log=logs[0], **loading.byte_limit())
    imu, _ = loading.load_logs(logs[0], None, rig, max_gap)
    if table is None:
        from rotcli.triad.handheld_run import calibrate_by_hand

        result = calibrate_by_hand(imu.crop(imu.time[0], imu.time[-1]), rig)
        used: list[Log] = [imu]
    else:
        from rotcli.triad.table_run import calibrate_on_table

        with messages.progress("calibrating") as told:
            result = calibrate_on_table(imu, table, rig, chosen, told)
        used = [imu, table]
    own = fields(result)
    own["warnings"] = [*(w for log in used for w in log.warnings), *own["warnings"]]
    return result, document(KIND, used, rig.effective(), own)


def _merged(paths: tuple[str, ...]) -> tuple["TriadResult", dict[str, Any]]:
    """Merge single-axis calibrations; return the result and its document."""
    from rotcli.errors import ResultError
    from rotcli.files.documents import document
    from rotcli.run.correction import KIND
    from rotcli.run.corrections import calibration_model
    from rotcli.triad.document import fields
    from rotcli.triad.merge import merge, read_column

    columns, docs = [], []
    for path in paths:
        model, doc = calibration_model(path)
        if model != "column":
            raise ResultError(f"{path}: model {model}; give results of rotcli calibrate")
        columns.append(read_column(path, doc))
        docs.append(doc)
    names = {str(doc.get("rig", {}).get("imu", {}).get("name")) for doc in docs}
    if len(names) > 1:
        raise ResultError(
            f"{paths[0]}: the calibrations are of different IMUs ({', '.join(sorted(names))}); "
            "merge those of one IMU"
        )
    result = merge(columns)
    merged = document(KIND, [], docs[0].get("rig", {}), fields(result))
    merged["inputs"] = [entry for doc in docs for entry in doc.get("inputs", [])]
    return result, merged


def _deliver(doc: dict[str, Any], output: str | None, quiet: bool) -> None:
    """Print all tables, or write the document."""
    from rotcli.files.documents import write_result
    from rotcli.files.tables import to_text
    from rotcli.triad.document import headline, tables

    messages.warn(doc["warnings"], quiet)
    if output is None:
        click.echo("\n".join(to_text(table) for table in tables(doc)), nl=False)
        return
    write_result(output, doc)
    if output != "-":
        messages.info(f"{output}: {headline(doc)}", quiet)
