"""Recordings of laboratory tests: one turn-on reduced to blocks, with base and noise figures.

Used by tests over many rates and temperatures, whose sigmas follow from the noise figures.
"""

import logging
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.files.results.documents import document
from rotcli.logs.record import ImuSource, Progress, TableLog
from rotcli.logs.temperature import TemperatureLog
from rotcli.models.base import FixedBase
from rotcli.models.earth import gravity_at
from rotcli.models.rotation import attitude_matrix
from rotcli.models.sensors import NoiseFigures
from rotcli.rig.rig import Rig
from rotcli.run.alignment.checks import check_lag
from rotcli.run.checks import judge
from rotcli.run.evidence.direction import check_direction
from rotcli.run.evidence.stillness import check_still_without_table
from rotcli.run.findings import Finding, texts
from rotcli.run.laboratory.blocks import (
    Reduced,
    gyro_figures,
    rate_segments,
    reduce_blocks,
    split_segments,
)
from rotcli.units import DEG, format_span

_log = logging.getLogger(__name__)
# Above 5 deg/s the rate exceeds every turn-on bias: direction and axis can be checked.
_CHECKED_RATE = 5.0 * DEG


@dataclass(frozen=True, eq=False)
class TurnOn:
    """Logs of one turn-on with their rig; temperature: None if there is none."""

    imu: ImuSource
    table: TableLog | None
    rig: Rig
    temperature: TemperatureLog | None = None

    @property
    def logs(self) -> list[ImuSource | TableLog]:
        """The logs as results name them."""
        return [self.imu] if self.table is None else [self.imu, self.table]


def fixed_base(rig: Rig) -> FixedBase:
    """Return the base whose Earth rate is compensated; RigError names the missing keys."""
    a = rig.attitude
    if rig.site is None or a.pitch is None or a.roll is None or a.azimuth is None:
        angles = {"pitch": a.pitch, "roll": a.roll, "azimuth": a.azimuth}
        missing = ["[site] latitude"] if rig.site is None else []
        missing += [f"[attitude] {name}" for name, angle in angles.items() if angle is None]
        raise RigError(
            f"{rig.path or 'no rig.toml'}: {', '.join(missing)}: missing; the compensation of "
            "Earth rate needs it: add it to the rig, or ignore Earth rate (earth_rate = ignore)"
        )
    gravity = gravity_at(rig.site.latitude, rig.site.height, rig.site.gravity)
    return FixedBase(rig.site.latitude, gravity, attitude_matrix(a.pitch, a.roll, a.azimuth))


def gyro_noise(
    rig: Rig,
) -> tuple[tuple[NoiseFigures, NoiseFigures, NoiseFigures], list[Finding]]:
    """Return the noise figures of the gyros, and a finding where slow noise is missing.

    Raises RigError where there is no angle random walk.
    """
    where = rig.path or "no rig.toml"
    figures = gyro_figures(rig.imu)
    if figures is None:
        raise RigError(
            f"{where}: [imu] angle_random_walk: missing; all sigmas follow from the noise figures: "
            "add them to the rig (a still log of hours measures them: rotcli allan)"
        )
    if all(f.bias_instability or f.rate_random_walk or f.markov_sigma for f in figures):
        return figures, []
    text = (
        f"{where}: [imu] contains no bias_instability, rate_random_walk or gauss_markov figures. "
        "The sigmas are those of white noise alone, and biases change by more; measure the "
        "figures on a still log of hours"
    )
    return figures, [Finding("noise-figures-missing", text, where="rig")]


def reduce_turn_on(
    run: TurnOn,
    base: FixedBase | None,
    length: float | None = None,
    progress: Progress | None = None,
) -> tuple[Reduced, list[str]]:
    """Return the blocks of one turn-on and the warnings about its logs.

    length: s of a block, None for complete segments. Raises LogError where the logs do not
    belong together.
    """
    axis = run.rig.table.axis
    warnings = [*run.imu.warnings, *(run.table.warnings if run.table else ())]
    segments = rate_segments(run.imu, run.table, run.rig)
    if run.table is None:
        start, end = segments[0].start, segments[-1].end
        findings = check_still_without_table(run.imu, start, end, None)
    else:
        findings = check_lag(run.imu, run.table, axis, settings=run.rig.table)
    warnings += texts(judge("laboratory", findings))
    for segment in segments:
        motion = f"turning at {segment.rate / DEG:.6g} deg/s" if segment.rate else "still"
        _log.info("segment %s, %s", format_span(segment.start, segment.end), motion)
        if run.table is not None and abs(segment.rate) >= _CHECKED_RATE:
            judge("laboratory", check_direction(run.imu, run.table, run.rig, segment))
    reduced = reduce_blocks(
        run.imu,
        run.table,
        split_segments(segments, length),
        axis=axis,
        base=base,
        temperature=run.temperature,
        progress=progress,
    )
    return reduced, warnings


def with_path(findings: Iterable[Finding], runs: Iterable[TurnOn]) -> list[Finding]:
    """Return the findings with the names of the IMU logs before their texts."""
    paths = ", ".join(run.imu.path for run in runs)
    return [replace(finding, text=f"{paths}: {finding.text}") for finding in findings]


def laboratory_document(
    kind: str,
    runs: Sequence[TurnOn],
    fields: dict[str, Any],
    warnings: Iterable[str],
    findings: Iterable[Finding],
) -> dict[str, Any]:
    """Return the result document of a test: its logs, the last rig, each warning once."""
    fields = {**fields, "warnings": [*dict.fromkeys(warnings), *texts(findings)]}
    logs = [log for run in runs for log in run.logs]
    return document(kind, logs, runs[-1].rig.effective(), fields)
