"""Compare the mean specific force with gravity in the attitude of the rig."""

import numpy as np

from rotcli.logs.record import ImuSource
from rotcli.run.findings import Finding
from rotcli.units import DEG, FloatArray

_MAX_SIZE_RATIO = 1.25  # a quarter: accelerometer scale errors are below a tenth, units are not
_SIZE_TOLERANCE = 0.03  # of g: scale errors of uncalibrated MEMS accelerometers
_WRONG_AXES = 30.0  # deg: more is a wrong axis or sign, not a tilted table
_TILT_TOLERANCE = 3.0  # deg: accelerometer biases of 50 mg
_REVERSED = 150.0  # deg: gravity with the opposite sign, 30 deg from it at most


def check_gravity(imu: ImuSource, f_b: FloatArray, expected: FloatArray) -> tuple[Finding, ...]:
    """Compare the mean specific force f_b (3,), m/s^2, with the expected one.

    f_b: in the body frame of the still base. Codes: `gravity-size`, `gravity-direction` (wrong
    units or axes), `gravity-reversed`, `gravity-scale` and `attitude-tilt` (inaccurate).
    """
    if not any(name.startswith("accel") for name in imu.channels):
        return ()
    size, g = float(np.linalg.norm(f_b)), float(np.linalg.norm(expected))
    tilt = float(np.arctan2(np.linalg.norm(np.cross(f_b, expected)), f_b @ expected)) / DEG
    measured = f"{imu.path}: the mean specific force is {size:.4g} m/s^2, gravity {g:.4g} m/s^2"
    placed = f"{imu.path}: gravity is {tilt:.1f} deg from the direction of [attitude]"
    found = []
    if not 1.0 / _MAX_SIZE_RATIO < size / g < _MAX_SIZE_RATIO:
        text = f"{measured}: {_likely_unit(size, g, imu.interval)}"
        found.append(Finding("gravity-size", text, "warning", "accel", size, g, "m/s^2"))
    elif abs(size / g - 1.0) > _SIZE_TOLERANCE:
        text = f"{measured}: check the unit"
        found.append(Finding("gravity-scale", text, "warning", "accel", size, g, "m/s^2"))
    if tilt > _REVERSED:
        text = (
            f"{placed}: the accelerometers report gravity, not specific force (set [imu] "
            "reports_gravity = true), or the IMU points down (correct [imu] mount)"
        )
        found.append(Finding("gravity-reversed", text, "warning", "accel", tilt, _REVERSED, "deg"))
    elif tilt > _WRONG_AXES:
        components = ", ".join(f"{v:.3g}" for v in f_b)
        text = f"{placed}, ({components}) m/s^2 in the body frame; check [attitude], [imu] mount"
        text += " and [table] axis"
        found.append(
            Finding("gravity-direction", text, "warning", "accel", tilt, _WRONG_AXES, "deg")
        )
    elif tilt > _TILT_TOLERANCE:
        text = f"{placed}; correct [attitude]"
        found.append(
            Finding("attitude-tilt", text, "warning", "accel", tilt, _TILT_TOLERANCE, "deg")
        )
    return tuple(found)


def _likely_unit(size: float, g: float, interval: float) -> str:
    """Return the likely cause of a specific force of another size (m/s^2)."""
    low, high = 1.0 / _MAX_SIZE_RATIO, _MAX_SIZE_RATIO
    if low < size < high:
        return "in g? set the unit in the header or as [imu] units accel"
    if low < size / g / interval < high:
        return "increments? set [imu] sampling"
    return "check the unit, and the order of the columns"
