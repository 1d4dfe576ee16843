"""What the logs and the rig of a table run give to the estimate: samples, table, mountings."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rotcli.errors import RigError
from rotcli.logs.record import ImuSource, Progress
from rotcli.logs.table_axes import AxesLog, table_axes
from rotcli.models.earth import gravity_at
from rotcli.models.rotation import attitude_matrix
from rotcli.models.triad.blocks import Blocks
from rotcli.models.triad.kinematics import Table
from rotcli.rig.rig import ImuSettings, Rig
from rotcli.run.findings import Finding
from rotcli.triad.table.reduction import ImuClock, Samples

MIN_USED = 0.3  # of the time; less means that most of the log is no data
_PERPENDICULAR = 1e-3  # cosine; the crookedness of a table is estimated, not given


def samples_of(
    imu: ImuSource, settings: ImuSettings, progress: Progress | None
) -> tuple[ImuClock, Iterator[Samples]]:
    """Return the clock of the samples and their readings chunk by chunk.

    Interpolated and clipped samples are not finite, so that their blocks are excluded.
    """
    limits = ((slice(0, 3), settings.gyro_range), (slice(3, 6), settings.accel_range))
    start = float(imu.time[0])
    shift = 0.5 * imu.interval if imu.sampling == "average" else 0.0
    everything = slice(0, imu.samples)

    def chunks() -> Iterator[Samples]:
        first = 0
        for piece in imu.chunks(everything):
            readings = np.concatenate([piece.gyro, piece.accel], axis=1)
            if piece.missing is not None:
                readings[piece.missing] = np.nan
            for columns, limit in limits:
                if limit is not None:
                    clipped = np.any(np.abs(readings[:, columns]) >= limit, axis=1)
                    readings[clipped] = np.nan
            yield Samples(first, readings)
            first += len(piece.time)
            if progress:
                progress(first / imu.samples)

    return ImuClock(start - shift, imu.interval), chunks()


def nominal_table(rig: Rig) -> Table:
    """Return the table that the rig describes; raises RigError without a site."""
    if rig.site is None:
        raise RigError(
            f"{rig.path or 'no rig.toml'}: [site] latitude: missing; gravity and Earth rate need it"
        )
    attitude = rig.attitude
    C_nb = attitude_matrix(attitude.pitch or 0.0, attitude.roll or 0.0, attitude.azimuth or 0.0)
    mounts = [m.mount.T for m in rig.mountings] or [np.eye(3)]
    gravity = gravity_at(rig.site.latitude, rig.site.height, rig.site.gravity)
    axes = np.array(table_axes(rig))
    for k in range(1, len(axes)):
        if abs(float(axes[k] @ axes[k - 1])) > _PERPENDICULAR:
            raise RigError(
                f"{rig.path or 'rig'}: [table] axes: axes {k} and {k + 1} are not perpendicular; "
                "give them with all table angles zero"
            )
    return Table(axes, C_nb, np.array(mounts), rig.site.latitude, gravity)


def with_mountings(blocks: Blocks, rig: Rig, interval: float) -> Blocks:
    """Return the blocks that lie within a mounting, with its index."""
    if not rig.mountings:
        return blocks
    index = np.full(len(blocks), -1)
    half = 0.5 * interval * blocks.count
    for m, mounting in enumerate(rig.mountings):
        inside = (blocks.time - half >= mounting.start) & (blocks.time + half <= mounting.end)
        index[inside] = m
    return replace(blocks, mounting=index).part(index >= 0)


def unused_time(used: float, table: AxesLog, imu: ImuSource) -> list[Finding]:
    """Return a finding where blocks contain little of the time (s) that both logs cover."""
    start = max(float(table.time[0]), float(imu.time[0]))
    share = used / max(min(float(table.time[-1]), float(imu.time[-1])) - start, used)
    if share >= MIN_USED:
        return []
    return [
        Finding(
            "little-used",
            f"{table.path}: only {share:.0%} of the time is used: elsewhere the table's "
            "acceleration is not constant, or the encoder is too coarse to show that. Log the "
            "angle with more digits, and turn at constant rates",
            value=share,
            limit=MIN_USED,
        )
    ]
