"""rotcli: turntable logs of an IMU to noise, calibration, navigation and observability results.

The law of units: inside the program everything is SI and radians and names carry no unit
(`w_ib_b`, `latitude`, `time`). At a door of the program (a log column, a rig key, a command-line
option, a JSON key) the unit is always named (`gyro_x [deg/s]`, `rate_dps`, `height_m`).

The law of frames: `n` navigation (East-North-Up), `b` body (x right, y forward, z up), `s` sensor
(turns with the table), `i` inertial, `e` Earth-fixed. `C_ab` takes a vector from b to a, so
letters cancel: `v_n = C_nb @ v_b`, `C_ns = C_nb @ C_bs`. `w_ib_b` is the rate of b against i,
seen in b.
"""

__version__ = "0.1.0"
