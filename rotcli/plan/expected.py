"""Expected RMS of a navigation with the planned IMU: what accuracy the test can lead to.

R16's run (still, turning, 300 s of navigation) with the noise figures of the rig, about the
vertical, at the largest rate of the plan and at 10, 50 and 100 deg/s: conventional, with biases
only (the axis column known to scale_sigma), and fully calibrated.
"""

import numpy as np

from rotcli.models.earth import gravity_at
from rotcli.models.expected.motion import StillTable
from rotcli.models.expected.plan import PlannedSensors
from rotcli.models.expected.planned_runs import PlannedExpectation, planned_expectation
from rotcli.rig.noise_sources import accel_noise, gyro_noise, missing_figures
from rotcli.rig.rig import DEFAULT_SITE, Rig
from rotcli.units import DEG

DURATION = 300.0  # s, R16 section 4
AXIS = "z"  # vertical: the axis of the smallest error


def plan_expectation(rig: Rig, max_rate: float) -> PlannedExpectation:
    """Return the expected RMS of each mode and rate, or why there is none; max_rate: deg/s."""
    missing = missing_figures(rig.imu)
    if missing:
        return PlannedExpectation(reason=f"[imu] lacks {', '.join(missing)}")
    site = rig.site or DEFAULT_SITE
    gravity = gravity_at(site.latitude, site.height, site.gravity)
    prior = rig.imu.figure("scale_sigma")
    sensors = PlannedSensors(
        gyro=tuple(gyro_noise(rig.imu)),
        accel=tuple(accel_noise(rig.imu)),
        matrix=np.zeros((3, 3)),
        matrix_sigma=0.0 if prior is None else float(np.max(prior)),
    )
    found = planned_expectation(
        sensors,
        StillTable(site.latitude, site.height, gravity),
        axes=(AXIS,),
        rate=max_rate * DEG,
        duration=DURATION,
    )
    if prior is not None:
        return found
    return found.without("partial", "[imu] scale_sigma is missing")
