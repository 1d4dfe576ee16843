"""Name the line of the rig that corrects gyros, or a table, whose rates differ by 57.3."""

import numpy as np

from rotcli.logs.record import ImuLog
from rotcli.rig.rig import Rig
from rotcli.units import DEG

_UNIT_RATIO = 1.0 / DEG  # rad/s read as deg/s
_TOLERANCE = 0.1  # of the ratio: a turn-on bias of 1.5 deg/s is then 0.026 deg/s
_OF_NOISE = 3.0  # factor within which the noise of a channel shows the ratio: gyros of one type


def unit_cause(log: ImuLog, rig: Rig, ratio: float) -> str | None:
    """Return cause and advice where the gyro rate is 57.3 times the table rate, or a 57.3th.

    ratio: of the gyro rate to the table rate. One gyro of three is recognised by its noise, a table
    by the noise of the gyros if the rig has angle_random_walk. None for another ratio.
    """
    large = abs(ratio / _UNIT_RATIO - 1.0) < _TOLERANCE
    if not large and abs(ratio * _UNIT_RATIO - 1.0) >= _TOLERANCE:
        return None
    true, read = ("deg/s", "rad/s") if large else ("rad/s", "deg/s")
    factor = DEG if large else _UNIT_RATIO
    scatter = np.diff(log.gyro @ rig.imu.mount.T, axis=0).std(axis=0)  # as the log has the channels
    main = int(np.argmax(np.abs(rig.imu.mount @ rig.table.axis)))
    others = float(np.median(np.delete(scatter, main)))
    excess = float(scatter[main]) * factor / others if others else 0.0
    if 1.0 / _OF_NOISE < excess < _OF_NOISE:  # this gyro alone has the ratio in its noise
        name = f"gyro_{'xyz'[main]}"
        said = f"{name} is in {true} and read as {read}"
        if rig.imu.scale:
            return f"a factor of 57.3: {said}; multiply [imu] scale of {name} by {factor:.6g}"
        numbers = ", ".join(f"{factor:.6g}" if k == main else "1" for k in range(3))
        return f"a factor of 57.3: {said}; set [imu] scale = {{ gyro = [{numbers}] }}"
    gyros = f'[imu] units = {{ gyro = "{true}" }}'
    angle = '[table] units = "rad"' if large else '[table] units = "deg"'
    white = rig.imu.figure("angle_random_walk")
    if white is None or not white[main]:
        return f"a factor of 57.3: set {gyros}, or {angle}, whichever log has the other unit"
    measured = float(scatter[main]) * np.sqrt(0.5 * log.interval)
    off = abs(np.log(measured / white[main])) > abs(np.log(measured * factor / white[main]))
    if off:
        return f"a factor of 57.3: the gyros are in {true} and read as {read}; set {gyros}"
    other, wrong = ("rad", "deg") if large else ("deg", "rad")
    return f"a factor of 57.3: the table angle is in {other} and read as {wrong}; set {angle}"
