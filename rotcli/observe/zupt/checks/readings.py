"""Check the readings of a log before the filter: not measured, disturbed, unsteady.

The filter lets its biases follow a drift and its tilts a wrong azimuth. The same tests as those of
a calibration show both: segments at constant rate, one bias, one scale factor, and the Earth rate
as a sine of the table angle.
"""

from collections.abc import Iterable

import numpy as np

from rotcli.logs.record import ImuSource, Segment, TableLog
from rotcli.models.base import FixedBase
from rotcli.models.earth import gravity_at
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.rotation import attitude_matrix
from rotcli.rig.rig import Rig
from rotcli.run.checks import judge
from rotcli.run.consistency.blocks import reduce_segments
from rotcli.run.consistency.log_fit import LogFit
from rotcli.run.consistency.means import TriadNoise
from rotcli.run.consistency.rig_noise import slow_noise_of
from rotcli.run.consistency.steadiness import check_steadiness
from rotcli.run.consistency.white_noise import estimate_white_noise
from rotcli.run.evidence.samples import SampleScan
from rotcli.run.findings import Finding
from rotcli.run.motion import encoder_noise
from rotcli.run.stages import all_segments

_MAX_DURATION = 7200.0  # s of a log that are tested: biases of longer ones drift by more
_MIN_DURATION = 5.0  # s of a segment, a part of the test of the fit
# of the fit of a clean log: the biases of the filter follow slow drifts, so less than for a
# calibration is said about them
_FALSE_ALARM = 1e-4
_MARGIN = 0.5  # s at either end of a segment, into which a ramp may reach
# Findings whose samples would contradict the fit and the Earth rate as well: one cause is enough.
_CAUSES = ("copied-rows", "table-angle", "clock-lag-large", "samples-not-measured")


def check_readings(
    imu: ImuSource,
    table: TableLog | None,
    rig: Rig,
    span: slice,
    before: Iterable[Finding] = (),
) -> tuple[Finding, ...]:
    """Return the findings about the readings of a span of samples; no table log: it is still.

    before: findings about the logs; where they explain what the fit would show, it is not tested.
    """
    scan = SampleScan()
    for chunk in imu.chunks(span):
        scan.add(chunk)
    start, end = (float(imu.times(slice(k, k + 1))[0]) for k in (span.start, span.stop - 1))
    end = min(end, start + _MAX_DURATION)
    found = scan.findings(imu.path)
    explained = any(f.code in _CAUSES for f in (*before, *found))
    unsteady = _check_segments(imu, table, rig, (start, end), explained=explained)
    return judge("observe", [*found, *unsteady])


def base_if_known(rig: Rig) -> FixedBase | None:
    """Return the base of a rig with site and complete attitude, else None."""
    angles = rig.attitude.pitch, rig.attitude.roll, rig.attitude.azimuth
    if rig.site is None or any(angle is None for angle in angles):
        return None
    site = rig.site
    gravity = gravity_at(site.latitude, site.height, site.gravity)
    pitch, roll, azimuth = (float(angle or 0.0) for angle in angles)
    return FixedBase(site.latitude, gravity, attitude_matrix(pitch, roll, azimuth))


def _check_segments(
    imu: ImuSource,
    table: TableLog | None,
    rig: Rig,
    span: tuple[float, float],
    *,
    explained: bool,
) -> list[Finding]:
    """Test the segments at constant rate in a span (s); explained: as `LogFit`."""
    start, end = span
    base = base_if_known(rig)
    if base is None:
        return []
    if table is None:
        time, interval = np.array([start, end]), end - start
        table = TableLog("no table log", time, np.zeros(2), interval)
        segments = [Segment(start, end)]
    else:
        segments = _cut(all_segments(table, imu, rig.table.axis), start, end)
    if not segments:
        return []
    u = rig.table.axis
    blocks = reduce_segments(imu, table, segments, u)
    turning = [b for b in blocks if b.segment.rate]
    unsteady = [f for f in check_steadiness(imu.path, turning) if f.code != "samples-not-measured"]
    known = rig.imu.figure("angle_random_walk")
    white = estimate_white_noise(blocks, None, u) if known is None else known
    slow = slow_noise_of(rig.imu)
    _, tested = LogFit(
        path=imu.path,
        table=table,
        blocks=blocks,
        u=u,
        base=base,
        noise=TriadNoise(white, slow or [SlowNoise()] * 3),
        encoder=encoder_noise(table),
        known=slow is not None,
        azimuth=rig.attitude.azimuth or 0.0,
        scaled=False,
        false_alarm=_FALSE_ALARM,
        explained=explained or bool(unsteady),
    ).test()
    return [*unsteady, *tested]


def _cut(segments: list[Segment], start: float, end: float) -> list[Segment]:
    """Return the segments between start and end (s), those that remain long enough."""
    cut = []
    for s in segments:
        first, last = max(s.start + _MARGIN, start), min(s.end - _MARGIN, end)
        if last - first >= _MIN_DURATION:
            cut.append(Segment(first, last, s.rate, s.rate * (last - first)))
    return cut
