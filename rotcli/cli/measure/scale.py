"""`rotcli scale`: scale factor over rates."""

from typing import Any

import click

from rotcli.cli import messages, options, output
from rotcli.cli.measure import laboratory

_MODELS = ("line", "asym", "quad", "odd", "cubic", "asym+odd", "table")


@click.command(
    epilog=options.example(
        "rotcli simulate --scenario scale-test --seed 1 -o run",
        "rotcli scale run/imu.parquet run/table.parquet -o run/scale.json",
    )
)
@click.argument("logs", nargs=-1, required=True, metavar="IMU_LOG TABLE_LOG …")
@options.rig
@click.option("--model", type=click.Choice(_MODELS), help="Error curve [default: tested].")
@click.option(
    "--full-scale",
    type=options.NOT_NEGATIVE,
    metavar="DEG_S",
    help="Rate that ppm of full scale refer to [default: gyro_range of the rig, else the largest].",
)
@click.option(
    "--horizon",
    type=options.WINDOW,
    help="Window of the predicted bias, s [default: the rig's navigation, else the next 300 s].",
)
@click.option(
    "--block",
    type=options.NOT_NEGATIVE,
    metavar="S",
    help="Cut segments into blocks of this length [default: complete segments].",
)
@click.option(
    "--earth-rate",
    type=click.Choice(["compensate", "ignore"]),
    default="compensate",
    show_default=True,
    help="Remove the Earth rate from the readings, or not.",
)
@click.option("--plot", "plot_path", metavar="FILE", help="Draw the curve (.png, .svg, .pdf).")
@options.max_gap
@options.max_bytes
@options.output
def command(
    logs: tuple[str, ...],
    rig_path: str | None,
    model: str | None,
    full_scale: float | None,
    horizon: tuple[float, float] | None,
    block: float | None,
    earth_rate: str,
    plot_path: str | None,
    max_gap: int,
    output: str | None,
    quiet: bool,
) -> None:
    """Measure scale factor, asymmetry, nonlinearity and hysteresis over rates.

    The logs contain segments at many constant rates about one axis; alternate the signs. Several
    pairs of logs are several turn-ons of one IMU: they give the repeatability.
    """
    _check_names(logs, rig_path, output, plot_path)
    warnings: list[str] = []
    runs = laboratory.open_pairs(logs, rig_path, max_gap, tables=True)
    result = _estimate(runs, model, full_scale, horizon, block, earth_rate, warnings)
    _write(runs, result, warnings, plot_path, output, quiet)


def _check_names(
    logs: tuple[str, ...], rig_path: str | None, result: str | None, plot_path: str | None
) -> None:
    from rotcli.files.figures import figure_format

    if plot_path:
        figure_format(plot_path)
    output.check_outputs([*logs, rig_path], {"-o": result, "--plot": plot_path}, log=logs[0])


def _estimate(
    runs: list[laboratory.LabLog],
    model: str | None,
    full_scale: float | None,
    horizon: tuple[float, float] | None,
    block: float | None,
    earth_rate: str,
    warnings: list[str],
) -> Any:
    """Return the result of the test; LogError where the rates do not allow it."""
    from rotcli.errors import LogError
    from rotcli.scale.estimate import estimate_scale
    from rotcli.units import DEG

    rig = runs[-1].rig
    noise = laboratory.gyro_noise(rig, warnings)
    base = laboratory.fixed_base(rig, earth_rate)
    blocks = tuple(laboratory.reduce(run, base, block, warnings).gyro for run in runs)
    rated = DEG * full_scale if full_scale else rig.imu.gyro_range
    try:
        return estimate_scale(
            blocks,
            noise,
            axis_name=rig.table.axis_name,
            axis=rig.table.axis,
            full_scale=rated,
            horizon=horizon or rig.stages.navigation,
            model=model,
        )
    except ValueError as error:
        raise LogError(runs[0].imu.path, f"{error}; add segments at other rates") from error


def _write(
    runs: list[laboratory.LabLog],
    result: Any,
    warnings: list[str],
    plot_path: str | None,
    target: str | None,
    quiet: bool,
) -> None:
    from rotcli.files.documents import document
    from rotcli.files.tables import to_text
    from rotcli.scale import document as scale_document
    from rotcli.scale.tables import tables

    logs = [file for run in runs for file in run.files]
    texts = laboratory.in_words(result.findings, [run.imu.path for run in runs])
    fields = {**scale_document.to_fields(result), "warnings": [*dict.fromkeys(warnings), *texts]}
    doc = document(scale_document.KIND, logs, runs[-1].rig.effective(), fields)
    if plot_path:
        from rotcli.scale.plot import plot

        plot(doc, plot_path)
        messages.tell(f"wrote {plot_path}")
    shown = tables(doc)
    output.deliver(doc, shown[0], target, quiet, scale_document.one_line_summary)
    if target is None:
        click.echo("\n" + "\n".join(to_text(table) for table in shown[1:]), nl=False)
