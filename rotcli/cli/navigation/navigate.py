"""`rotcli navigate`: inertial navigation of a log on a still table."""

from collections.abc import Iterator
from typing import Any

import click

from rotcli.cli import loading, messages, options
from rotcli.cli import output as delivery
from rotcli.cli.batch import run as batch

MODES = ("conventional", "partial", "full")


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 10 --seed 1 -o run",
        "rotcli calibrate run/imu.parquet run/table.parquet -o run/calibration.json",
        "rotcli navigate run/imu.parquet run/table.parquet --calibration run/calibration.json",
    )
)
@click.argument("imu_log", required=False)
@click.argument("table_log", required=False)
@options.rig
@click.option(
    "--mode",
    "modes",
    type=click.Choice(MODES),
    multiple=True,
    help="conventional: biases from the still minute; partial: a calibration's biases; full: its "
    "scale factor and installation errors too. May be given more than once: then -o, --solution "
    "and --plot take {mode} in the name. [default: full with --calibration, else conventional]",
)
@click.option("--calibration", metavar="FILE", help="Result of rotcli calibrate.")
@click.option(
    "--allow-other-rate", is_flag=True, help="Accept a calibration made at another table rate."
)
@click.option("--window", type=options.WINDOW, help="What to navigate, s [default: the rig's].")
@click.option(
    "--static",
    type=options.WINDOW,
    help="Still stretch for the biases of conventional, s [default: the rig's, else found].",
)
@click.option(
    "--height",
    type=click.Choice(["free", "hold"]),
    default="free",
    show_default=True,
    help="Let height diverge as in the papers, or hold it.",
)
@click.option("--solution", metavar="FILE", help="Write the time series (.parquet or .csv).")
@click.option("--plot", metavar="FILE", help="Draw the errors against time (.png, .svg, .pdf).")
@options.max_gap
@options.max_bytes
@batch.options
@options.output
def command(
    imu_log: str | None, table_log: str | None, output: str | None, quiet: bool, **given: Any
) -> None:
    """Navigate a log and take the errors against the still table.

    Without TABLE_LOG the IMU is taken as still. The RMS errors over the window are printed;
    -o writes them as JSON.
    """
    named = (("-o", output), ("--solution", given["solution"]), ("--plot", given["plot"]))
    for option, name in named:
        several = len(given["modes"]) > 1 and not (option == "-o" and given["batch"])
        if several and name not in (None, "-") and "{mode}" not in str(name):
            raise click.UsageError(f"{option}: with several modes put {{mode}} in the name")
    if given["batch"]:
        batch.run("navigate", (imu_log, table_log), output, quiet, given)
        return
    if not given["calibration"] and set(given["modes"]) - {"conventional"}:
        raise click.UsageError("partial and full need --calibration (see rotcli calibrate)")

    from rotcli.navigate import document as navigation

    imu_log = batch.needed(imu_log, "IMU_LOG")
    for mode in given["modes"] or ("full",):
        delivery.check_outputs(
            [table_log, given["rig_path"], given["calibration"]],
            {option: name and name.replace("{mode}", mode) for option, name in named},
            log=imu_log,
        )
    docs = documents(imu_log, table_log, given)
    delivery.deliver(docs, navigation.table(docs), output, quiet, navigation.headline)


def documents(imu_log: str, table_log: str | None, given: dict[str, Any]) -> list[Any]:
    """Navigate one run; return the document of each mode, series and plots written."""
    from rotcli.navigate import modes
    from rotcli.navigate.estimate import prepare
    from rotcli.run.correction import read_correction

    wanted = given["modes"] or ("full" if given["calibration"] else "conventional",)
    rig = loading.load_rig(given["rig_path"], imu_log)
    rig = loading.lay_over(
        rig, {"stages": {"static": given["static"], "navigation": given["window"]}}
    )
    imu, table = loading.load_logs(imu_log, table_log, rig, given["max_gap"])
    correction = None
    if given["calibration"]:
        correction = read_correction(given["calibration"])
        correction.check_imu_name(rig.imu.name)
    run, place = prepare(imu, table, rig, need_static="conventional" in wanted)
    free = given["allow_other_rate"] or not set(wanted) - {"conventional"}
    other_rate = modes.mismatch(run, correction, allowed=free)
    named = bool(given["static"])
    made = []
    for mode in wanted:
        errors = modes.removed(run, place.base, mode, correction, other_rate, static_named=named)
        made.append(_navigate(run, place, errors, mode, rig, correction, given))
    return made


def _navigate(
    run: Any, place: Any, errors: Any, mode: str, rig: Any, correction: Any, given: dict[str, Any]
) -> Any:
    """Navigate in one mode, part by part; write series and plot and return the document."""
    from rotcli.files.documents import document
    from rotcli.navigate import document as navigation
    from rotcli.navigate.assess import assess
    from rotcli.navigate.estimate import Summary, navigate_parts
    from rotcli.run.findings import texts

    summary = Summary(mode, run.rate)
    thinned = navigation.Thinned(run.window.stop - run.window.start)
    solution, plot = (
        name and name.replace("{mode}", mode) for name in (given["solution"], given["plot"])
    )

    def series(told: messages.Progress | None) -> Iterator[dict[str, Any]]:
        """Yield the time series part by part, the figures taken on the way."""
        hold = given["height"] == "hold"
        parts = navigate_parts(
            run, place, errors.gyro, errors.accel, mode=mode, hold_height=hold, progress=told
        )
        for part in parts:
            summary.add(part)
            if solution or plot:
                columns = navigation.solution(part)
                if plot:
                    thinned.add(columns)
                yield columns

    messages.tell(_told(run, mode))
    with messages.progress(f"navigating {mode}") as told:
        if solution:
            delivery.write_parts(solution, series(told))
        else:
            for _ in series(told):
                pass
    hold = given["height"] == "hold"
    found = assess(run, place, rig, errors, correction, summary, hold_height=hold)
    logs = [log for log in (run.imu, run.table) if log]
    warnings = [*run.warnings, *errors.warnings, *summary.warnings, *found.warnings]
    findings = found.verdict.findings
    own = {
        **navigation.fields(summary),
        **navigation.assessment_fields(found, rig),
        "findings": [finding.to_dict() for finding in findings],
        "warnings": [*warnings, *texts(findings)],
    }
    doc = document(navigation.KIND, logs, rig.effective(), own)
    if plot:
        from rotcli.files import captions
        from rotcli.files.figures import navigation_errors, save_figure

        title = captions.subject(doc, mode, captions.motion(doc, constant_rate=run.constant_rate))
        expected = navigation.envelope(found)
        figure = navigation_errors(thinned.columns(), title, captions.log(doc), expected)
        save_figure(figure, plot)
    return doc


def _told(run: Any, mode: str) -> str:
    """Return what --verbose says of a run."""
    from rotcli.units import DEG, show_span

    parts = [f"navigating {mode}, table at {run.rate / DEG:.6g} deg/s"]
    for name, held in (("still", run.static), ("window", run.window)):
        if held is not None:
            first, last = (run.imu.times(slice(k, k + 1))[0] for k in (held.start, held.stop - 1))
            parts.append(f"{name} {show_span(first, last)}")
    return ", ".join(parts)
