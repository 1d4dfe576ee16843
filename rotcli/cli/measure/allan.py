"""`rotcli allan`: the noise figures of a still log."""

from typing import Any

import click

from rotcli.cli import loading, messages, options
from rotcli.cli import output as delivery

# A log is read faster whole than axis by axis; two million records still take little room.
_HELD = 10.0
_AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


class Axes(click.ParamType[tuple[str, ...]]):
    """Axes to analyse: a comma-separated list of column names."""

    name = "gyro_x,…"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[str, ...]:
        """Return the axes in the log's own order."""
        if isinstance(value, tuple):
            return value
        names = {part.strip() for part in str(value).split(",")}
        wrong = sorted(names - set(_AXES))
        if wrong:
            self.fail(f"{wrong[0]!r} is none of {', '.join(_AXES)}", param, ctx)
        return tuple(name for name in _AXES if name in names)


class Taus(click.ParamType[str | list[float]]):
    """Cluster times: `octave`, `decade`, `all`, or a comma-separated list of seconds."""

    name = "octave|decade|all|LIST"

    def convert(self, value: Any, param: Any, ctx: Any) -> str | list[float]:
        """Return the word or the times."""
        if isinstance(value, list) or value in ("octave", "decade", "all"):
            return value  # type: ignore[no-any-return]
        try:
            return [float(part) for part in str(value).split(",")]
        except ValueError:
            self.fail(f"{value!r} is not octave, decade, all or times in seconds", param, ctx)


@click.command(
    epilog=options.example(
        "rotcli simulate --imu mti-g --rate 0 --static 3600 --navigation 0 --seed 1 -o still",
        "rotcli allan still/imu.parquet -o still/allan.json --plot still/allan.png",
    )
)
@click.argument("imu_log")
@click.option("--window", type=options.WINDOW, help="Use only this part of the log, s.")
@click.option("--axes", type=Axes(), default=",".join(_AXES), help="[default: all six]")
@click.option("--taus", type=Taus(), help="Cluster times [default: 15 a decade].")
@click.option(
    "--estimator",
    type=click.Choice(["oadev", "adev", "mdev", "totdev"]),
    default="oadev",
    show_default=True,
    help="The curve's deviation; the figures are always those of oadev.",
)
@click.option("--plot", "plot_path", metavar="FILE", help="Draw the curves: png, svg or pdf.")
@click.option("--to-rig", metavar="RIG", help="Write the figures into the [imu] of this rig.")
@options.max_bytes
@options.rig
@options.output
def command(
    imu_log: str,
    window: tuple[float, float] | None,
    axes: tuple[str, ...],
    taus: str | list[float] | None,
    estimator: str,
    plot_path: str | None,
    to_rig: str | None,
    rig_path: str | None,
    output: str | None,
    quiet: bool,
) -> None:
    """Measure the noise of a still log: Allan deviation, coefficients, Gauss-Markov figures.

    The longest clean still stretch is used. A coefficient that the record cannot support is left
    out with the reason and an upper limit.
    """
    from rotcli.allan.estimate import allan
    from rotcli.units import show_span

    # --to-rig mends a rig, which may be the one that is read.
    delivery.check_outputs([rig_path, to_rig], {"-o": output, "--plot": plot_path}, log=imu_log)
    rig = loading.load_rig(rig_path, imu_log)
    log, _ = loading.load_logs(imu_log, None, rig, None, held=_HELD)
    with messages.progress("analysing") as told:
        result = allan(
            log,
            window=window,
            axes=axes,
            taus=taus,
            estimator=estimator,
            gyro_range=rig.imu.gyro_range,
            accel_range=rig.imu.accel_range,
            progress=told,
        )
    messages.tell(
        f"found still stretch {show_span(result.start, result.end)}, {result.samples} samples"
    )
    messages.warn(result.warnings, quiet)
    _write(result, log, rig, output, quiet, plot_path, to_rig)


def _write(
    result: Any,
    log: Any,
    rig: Any,
    output: str | None,
    quiet: bool,
    plot_path: str | None,
    to_rig: str | None,
) -> None:
    """Write the document or the tables, the plot, and the rig."""
    from rotcli.allan.document import KIND, curve_table, fields, table, write_to_rig
    from rotcli.files.documents import document, write_result
    from rotcli.files.tables import to_text

    doc = document(KIND, [log], rig.effective(), fields(result))
    if plot_path:
        from rotcli.allan.plot import plot

        plot(result, plot_path, doc)
        messages.say(f"{plot_path}: curves drawn", quiet)
    if to_rig:
        written = write_to_rig(to_rig, result)
        messages.say(f"{to_rig}: [imu] {', '.join(written) or 'nothing'} written", quiet)
    if output:
        write_result(output, doc)
        span = f"{result.end - result.start:.6g} s, {len(result.axes)} axes"
        if output != "-":
            messages.say(f"{output}: noise of {log.path}, {span}", quiet)
    else:
        click.echo(to_text(table(doc)) + "\n" + to_text(curve_table(doc)), nl=False)
