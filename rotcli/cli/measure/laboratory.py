"""Logs, base and noise figures of the laboratory tests `scale` and `thermal`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from rotcli.cli import loading, messages

if TYPE_CHECKING:
    from rotcli.logs.record import ImuSource, TableLog
    from rotcli.logs.temperature import TemperatureLog
    from rotcli.models.base import FixedBase
    from rotcli.models.findings import Finding
    from rotcli.models.sensors import NoiseFigures
    from rotcli.rig.rig import Rig
    from rotcli.run.blocks import Reduced


@dataclass(frozen=True, eq=False)
class LabLog:
    """One turn-on: its logs, rig, temperature (None if it has none)."""

    imu: "ImuSource"
    table: "TableLog | None"
    rig: "Rig"
    temperature: "TemperatureLog | None" = None

    @property
    def files(self) -> list[Any]:
        """The logs as results name them."""
        return [log for log in (self.imu, self.table) if log is not None]


def open_pairs(
    names: Sequence[str], rig_path: str | None, max_gap: int, *, tables: bool
) -> list[LabLog]:
    """Return the logs of the turn-ons: pairs of IMU and table log (tables: both are needed).

    One name alone, where no table is needed, is a still log.
    """
    if (
        not names
        or (tables and len(names) % 2)
        or (not tables and len(names) % 2 and len(names) > 1)
    ):
        raise click.UsageError("name pairs of logs: IMU_LOG TABLE_LOG, once per turn-on")
    pairs = (
        [(names[0], None)] if len(names) == 1 else list(zip(names[::2], names[1::2], strict=True))
    )
    found = []
    for imu_name, table_name in pairs:
        rig = loading.load_rig(rig_path, imu_name)
        imu, table = loading.load_logs(imu_name, table_name, rig, max_gap)
        found.append(LabLog(imu, table, rig))
    return found


def fixed_base(rig: "Rig", earth_rate: str) -> "FixedBase | None":
    """Return the base whose Earth rate is compensated; None with `ignore`.

    Raises RigError where the rig does not contain site and attitude.
    """
    from rotcli.errors import RigError
    from rotcli.models.base import FixedBase
    from rotcli.models.earth import gravity_at
    from rotcli.models.rotation import attitude_matrix

    if earth_rate == "ignore":
        return None
    a = rig.attitude
    missing = [
        f"[attitude] {name}"
        for name, angle in (("pitch", a.pitch), ("roll", a.roll), ("azimuth", a.azimuth))
        if angle is None
    ]
    if rig.site is None or a.pitch is None or a.roll is None or a.azimuth is None:
        missing = ["[site] latitude"] * (rig.site is None) + missing
        raise RigError(
            f"{rig.path or 'no rig.toml'}: {', '.join(missing)}: missing; the Earth rate cannot "
            "be compensated: add it to the rig (--rig), or use --earth-rate ignore"
        )
    gravity = gravity_at(rig.site.latitude, rig.site.height, rig.site.gravity)
    return FixedBase(rig.site.latitude, gravity, attitude_matrix(a.pitch, a.roll, a.azimuth))


def gyro_noise(
    rig: "Rig", warnings: list[str]
) -> "tuple[NoiseFigures, NoiseFigures, NoiseFigures]":
    """Return the noise figures of the gyros; warn without slow noise, RigError without any."""
    from rotcli.errors import RigError
    from rotcli.run.blocks import gyro_figures

    where = rig.path or "no rig.toml"
    figures = gyro_figures(rig.imu)
    if figures is None:
        raise RigError(
            f"{where}: [imu] angle_random_walk: missing; all sigmas follow from the noise figures: "
            "add them to the rig (rotcli allan measures them on a still log)"
        )
    slow = [f.bias_instability or f.rate_random_walk or f.markov_sigma for f in figures]
    if not all(slow):
        warnings.append(
            f"{where}: [imu] contains no bias_instability, rate_random_walk or gauss_markov "
            "figures. The sigmas are those of white noise alone, and biases change by more; "
            "measure them with rotcli allan on a still log of hours"
        )
    return figures


def reduce(
    log: LabLog, base: "FixedBase | None", length: float | None, warnings: list[str]
) -> "Reduced":
    """Return the blocks of one turn-on; length: s of a block, None for complete segments."""
    from rotcli.run.blocks import rate_segments, reduce_blocks, split_segments
    from rotcli.run.checks import check_direction, check_untabled
    from rotcli.run.lag import check_lag
    from rotcli.units import DEG, show_span

    axis = log.rig.table.axis
    warnings += [*log.imu.warnings, *(log.table.warnings if log.table else ())]
    if log.table is None:
        check_untabled(log.imu, float(log.imu.time[0]), float(log.imu.time[-1]), None)
    else:
        offset = log.rig.table.time_offset
        warnings += check_lag(log.imu, log.table, axis, time_offset=offset, strict=True)
    segments = rate_segments(log.imu, log.table, log.rig)
    for segment in segments:
        rate = f"at {segment.rate / DEG:.6g} deg/s" if segment.rate else "still"
        messages.tell(f"{log.imu.path}: {rate}: {show_span(segment.start, segment.end)}")
        if log.table is not None and abs(segment.rate) >= _DIRECTION_RATE:
            check_direction(log.imu, log.table, axis, segment)
    with messages.progress("averaging") as told:
        return reduce_blocks(
            log.imu,
            log.table,
            split_segments(segments, length),
            axis=axis,
            base=base,
            temperature=log.temperature,
            progress=told,
        )


# At 5 deg/s the rate exceeds every turn-on bias; below, direction and axis cannot be checked.
_DIRECTION_RATE = 0.0873  # rad/s


def in_words(findings: "Sequence[Finding]", paths: Sequence[str]) -> list[str]:
    """Return the warnings of the findings."""
    place = ", ".join(paths)
    return [f"{place}: {f.text}" for f in findings if f.severity == "warning"]
