"""Formats whose column names say everything: MicroStrain, SBG, ArduPilot, PX4."""

from rotcli.files.formats.base import LogFormat, triads


class MicroStrain(LogFormat):
    """CSV of MicroStrain's MIP Monitor and SensorConnect; the numbers in brackets are fields."""

    name = "microstrain"
    title = "MicroStrain (LORD, HBK) CSV export"
    source = "MicroStrain MIP data sets 0x80: fields 0x04 (g), 0x05 (rad/s), 0x12 (GPS time)"
    rig = {
        "columns": {"time": "GPS TOW", **triads("{} Gyro [x8005]", "{} Accel [x8004]", "XYZ")},
        "units": {"time": "s", "gyro": "rad/s", "accel": "g"},
        "delimiter": ",",
    }
    pattern = r"(?m)^[^\n]*X Gyro \[x8005\]"
    wraps = (604800,)


class Sbg(LogFormat):
    """Text of sbgBasicLogger: time in us, SI units, increments in further columns."""

    name = "sbg"
    title = "SBG Systems sbgBasicLogger IMU data"
    source = "SBG Systems sbgECom, SBG_ECOM_LOG_IMU_DATA (units)"
    rig = {
        "columns": {"time": "timestamp", **triads("gyro{}", "accel{}", "XYZ")},
        "units": {"time": "us", "gyro": "rad/s", "accel": "m/s^2"},
    }
    pattern = r"(?m)^timestamp[ \t,;]+status[ \t,;]+accelX\b.*\bgyroX\b"
    wraps = (1 << 32,)


class ArduPilot(LogFormat):
    """CSV of the IMU messages of a dataflash log; column I numbers the IMU."""

    name = "ardupilot"
    title = "ArduPilot dataflash IMU messages as CSV"
    source = "ardupilot.org, Onboard Message Log Messages, IMU"
    rig = {
        "columns": {"time": "TimeUS", **triads("Gyr{}", "Acc{}", "XYZ")},
        "units": {"time": "us", "gyro": "rad/s", "accel": "m/s^2"},
    }
    pattern = r"(?m)^[^\n]*\bTimeUS\b[^\n]*\bGyrX\b"


class Px4(LogFormat):
    """CSV of ulog2csv for the topic sensor_combined; the brackets number the axes."""

    name = "px4"
    title = "PX4 sensor_combined as CSV (ulog2csv)"
    source = "docs.px4.io, uORB message SensorCombined"
    rig = {
        "columns": {
            "time": "timestamp",
            **triads("gyro_rad[{}]", "accelerometer_m_s2[{}]", "012"),
        },
        "units": {"time": "us", "gyro": "rad/s", "accel": "m/s^2"},
        "delimiter": ",",
    }
    pattern = r"(?m)^timestamp,gyro_rad\[0\]"
