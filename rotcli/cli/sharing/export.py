"""`rotcli export`: figures of one IMU as a file of another program."""

import click

from rotcli.cli import messages, options
from rotcli.cli import output as outputs
from rotcli.dataclass import dataclass
from rotcli.files.text import visible
from rotcli.lazy import lazily

with lazily():
    from rotcli.export import figures, formats, numbers, thermal
    from rotcli.files.results import documents as files_documents
    from rotcli.files.results import find

# The names of `rotcli.export.formats.all_formats`, written here so that --help needs no numpy.
FORMATS = (
    "kalibr",
    "openvins",
    "orb-slam3",
    "lio-sam",
    "vins",
    "ros",
    "px4",
    "ardupilot",
    "matlab",
    "gnss-ins-sim",
    "gazebo",
    "navego",
    "psins",
)


@dataclass(frozen=True)
class ExportOptions:
    """Options of the command, as they are typed."""

    to: str
    axes: str
    walk_from: str
    inflate: float
    rate: float | None
    duration: float | None
    frame: str
    instance: int
    device_id: int


@click.command(
    epilog=options.example(
        "rotcli simulate --imu nav440 --rate 0 --static 600 --navigation 0 --seed 1 -o still",
        "rotcli allan still/imu.parquet -o still/allan.json",
        "rotcli export still/allan.json --to kalibr -o still/imu.yaml",
    )
)
@click.argument("results", nargs=-1, required=True, metavar="RESULT|DIR|GLOB…")
@click.option("--to", type=click.Choice(FORMATS), required=True, help="Program that reads it.")
@click.option(
    "--axes",
    type=click.Choice(("rms", "max")),
    default="rms",
    show_default=True,
    help="One value for three axes: their root mean square or the maximum.",
)
@click.option(
    "--walk-from",
    type=click.Choice(("limit", "bias")),
    default="limit",
    show_default=True,
    help="Where K is not significant: its 95 % upper limit, or the K that equals the floor of B "
    "after --duration.",
)
@click.option(
    "--duration",
    type=click.FloatRange(min=1.0),
    metavar="S",
    help="Navigation time for --walk-from bias [default: the rig's window, else 3600].",
)
@click.option(
    "--inflate",
    type=click.FloatRange(min=0.0, min_open=True),
    default=1.0,
    metavar="FACTOR",
    help="Multiply noise densities and walks (estimators with cameras use 5 to 20) [default: 1].",
)
@click.option(
    "--rate",
    type=click.FloatRange(min=0.0, min_open=True),
    metavar="HZ",
    help="Sample rate of the target [default: that of the log].",
)
@click.option(
    "--frame",
    type=click.Choice(("sensor", "frd")),
    default="sensor",
    show_default=True,
    help="Axes of an autopilot's parameters: the sensor's, or forward, right, down.",
)
@click.option(
    "--instance",
    type=click.IntRange(1, 3),
    default=1,
    show_default=True,
    help="Number of the sensor in the autopilot.",
)
@click.option(
    "--device-id", type=click.IntRange(min=0), default=0, help="PX4 device id (CAL_GYR0_ID)."
)
@options.messages
@click.option("-o", "--output", metavar="FILE", help="File to write [default: standard output].")
def command(results: tuple[str, ...], output: str | None, quiet: bool, **given: object) -> None:
    """Write the figures of one IMU as a file of another program.

    Results of allan, calibrate, triad, scale and thermal combine. The header of the file states
    source, rate, rules and the figures that the format cannot contain.
    """
    chosen = ExportOptions(**given)  # type: ignore[arg-type]
    outputs.check_outputs(results, {"-o": output})
    _export(results, output, quiet, chosen)


def _export(
    results: tuple[str, ...], output: str | None, quiet: bool, chosen: ExportOptions
) -> None:
    found = find.read_results(results, lambda doc: doc["kind"] in ("allan", "calibration"))
    messages.warn(found.remarks(), quiet)
    documents = [
        (thermal.Source(path, str(doc["kind"]), files_documents.sha256(path)), doc)
        for path, doc in found.documents
    ]
    settings = numbers.Settings(
        axes=chosen.axes,
        walk_from=chosen.walk_from,
        inflate=chosen.inflate,
        rate=chosen.rate,
        navigation=chosen.duration,
        frame=chosen.frame,
        instance=chosen.instance,
        device=chosen.device_id,
    )
    made = formats.render(chosen.to, figures.collect(documents), settings)
    files_documents.write_text(output or "-", visible(made.text))
    messages.warn(list(made.limits), quiet)
    if output not in (None, "-"):
        lost = f"; lost: {', '.join(made.lost)}" if made.lost else ""
        messages.info(f"{output}: {made.title}{lost}", quiet)
