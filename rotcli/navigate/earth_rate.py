"""Look for the Earth rate in the gyros of a window that turns at constant rate.

It appears as a sine of the table angle; a flipped or exchanged gyro, or a wrong azimuth, leaves one
in the residuals. The RMS errors of the navigation show the same much later.
"""

import numpy as np

from rotcli.logs.record import Segment
from rotcli.models.base import FixedBase
from rotcli.navigate.residuals import WindowMeans
from rotcli.rig.rig import Rig
from rotcli.run.consistency.blocks import EarthHarmonics, SegmentBlocks
from rotcli.run.consistency.harmonics import Harmonics, check_harmonics, residual_harmonics
from rotcli.run.consistency.rig_noise import slow_noise_of
from rotcli.run.evidence.samples import SampleScan
from rotcli.run.findings import Finding
from rotcli.run.recording import NavigationRun


def window_harmonics(
    run: NavigationRun, rig: Rig, base: FixedBase, window: WindowMeans
) -> Harmonics | None:
    """Return the sines of the table angle in the gyros of a window.

    None where the table does not turn at constant rate, or the rig has no noise figures.
    """
    white, slow = rig.imu.figure("angle_random_walk"), slow_noise_of(rig.imu)
    if run.table is None or not run.constant_rate or white is None or slow is None:
        return None
    size = round(window.length / run.imu.interval)
    duration = window.blocks * window.length
    segment = Segment(window.start, window.start + duration, run.rate, run.rate * duration)
    blocks = SegmentBlocks(
        segment=segment,
        start=window.start,
        interval=run.imu.interval,
        size=size,
        counts=np.full(window.blocks, float(size)),
        gyro=window.means[:3].T,
        cos=window.means[6],
        sin=window.means[7],
        within=np.zeros(3),
        force=np.zeros(3),
        scan=SampleScan(),
    )
    return residual_harmonics([blocks], EarthHarmonics.of(base, run.axis), white, slow)


def earth_rate_findings(
    run: NavigationRun, rig: Rig, base: FixedBase, harmonics: Harmonics | None
) -> tuple[Finding, ...]:
    """Return the finding of gyros that do not measure the Earth rate as the rig says."""
    azimuth = rig.attitude.azimuth or 0.0
    return check_harmonics(run.imu.path, harmonics, base, run.axis, azimuth)
