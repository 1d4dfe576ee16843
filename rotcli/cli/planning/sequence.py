"""`rotcli simulate --sequence`: logs of a sequence on a table of one to three axes."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from rotcli.cli import loading, messages
from rotcli.cli import output as delivery
from rotcli.errors import RigError
from rotcli.files.text import parse_toml, read_text
from rotcli.lazy import lazily

with lazily():
    from rotcli import units
    from rotcli.models.triad import parameters as p
    from rotcli.rig import profile as profiles
    from rotcli.rig import sequence as sequences
    from rotcli.simulate import sequence_run

if TYPE_CHECKING:
    from rotcli.units import FloatArray


def simulate(
    output: str,
    *,
    sequence: str,
    imu: str | None,
    errors: str | None,
    rig_path: str | None,
    seed: int | None,
    sampling: str | None,
    encoder_noise: float | None,
    as_csv: bool,
    quiet: bool,
) -> None:
    """Write the logs of a sequence with the errors of a profile, a file, or typical ones."""
    if not imu:
        raise click.UsageError("--sequence needs --imu")
    suffix = "csv" if as_csv else "parquet"
    for name in (f"imu.{suffix}", f"table.{suffix}", "rig.toml", "truth.json"):
        delivery.check_outputs([sequence, errors, rig_path], {"-o": str(Path(output) / name)})
    played = sequences.read_sequence(sequence)
    profile = profiles.read_profile(imu)
    count = len(played.mountings)
    number = seed or 0
    if errors == "typical":
        x = sequence_run.typical_errors(count, number)
        x[p.GYRO_ASYMMETRY] = x[p.ACCEL_ASYMMETRY] = 0.0
    elif errors:
        x = _errors_of_file(errors, count)
    else:
        x = sequence_run.errors_of_profile(profile, count) + played.errors
    noise = (1e-5 if encoder_noise is None else encoder_noise) * units.DEG
    rig = loading.load_rig(rig_path, None, {"imu": {"sampling": sampling}})
    scenario = sequence_run.SequenceScenario(played, profile, rig, x, number, noise)
    log = sequence_run.run_sequence(scenario)
    sequence_run.write_sequence_run(output, scenario, log, suffix)
    messages.info(f"{output}: {log.time[-1]:.6g} s of {profile.name}, {played.name}", quiet)


def _errors_of_file(path: str, mountings: int) -> "FloatArray":
    """Return the errors of a TOML file of parameter names."""
    try:
        values = parse_toml(read_text(path))
    except OSError as fault:
        raise RigError(f"{path}: cannot be read: {fault.strerror or fault}") from fault
    except ValueError as fault:
        raise RigError(f"{path}: not TOML: {' '.join(str(fault).split())}") from fault
    return sequences.read_errors(path, values.get("errors", values), mountings)
