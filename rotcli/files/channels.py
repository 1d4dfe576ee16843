"""The channels of logs, one row each: quantity, plausible limit and usual column names.

A row is all that a new channel needs: the rig allows its name under `columns` and its group
under `units`, and the readers load it where a log contains it.
"""

import math

from rotcli.dataclass import dataclass

# Readings above these limits are numbers of another unit or of no sensor: thousands of times the
# range of gyros (35 rad/s) and accelerometers (2000 m/s^2) that are built for turntables.
MAX_GYRO, MAX_ACCEL = 1e6, 1e6  # rad/s, m/s^2
MAX_TABLE_ANGLE = 1e9  # rad; a table of 1000 deg/s turns 3e6 rad in two days
MAX_TABLE_RATE = 1e4  # rad/s; ten times the fastest rate tables
MAX_HEIGHT, MAX_SPEED = 1e6, 1e4  # m, m/s, of a vehicle
MAX_TEMPERATURE = 1000.0  # degC


@dataclass(frozen=True)
class Channel:
    """One measured quantity of a log.

    group: key of `units`, `scale` and `offset` in the rig. quantity: kind of unit. increment:
    kind of unit of increments over a sample. limit: largest plausible reading, in `unit`, of
    a `noun`. optional: a log may lack it. names: usual column names, lower case.
    """

    name: str
    group: str
    quantity: str
    limit: float
    unit: str
    noun: str
    increment: str = ""
    optional: bool = False
    names: tuple[str, ...] = ()


def _triad(
    sensor: str, quantity: str, limit: float, unit: str, noun: str, increment: str
) -> list[Channel]:
    return [
        Channel(f"{sensor}_{axis}", sensor, quantity, limit, unit, noun, increment)
        for axis in "xyz"
    ]


TEMPERATURE = Channel(
    "temperature",
    "temperature",
    "temperature",
    MAX_TEMPERATURE,
    "degC",
    "temperature",
    optional=True,
    names=(
        "temperature",
        "temp",
        "imu_temp",
        "imu_temperature",
        "sensor_temperature",
        "temp_c",
        "temp_degc",
        "t_imu",
        "imu_t",
        "temperature_c",
        "gyro_temp",
        "gyro_temperature",
        "sensor_temp",
        "die_temp",
        "temperatur",
        "thermometer",
    ),
)
IMU_CHANNELS = (
    *_triad("gyro", "rate", MAX_GYRO, "rad/s", "gyro", "angle"),
    *_triad("accel", "acceleration", MAX_ACCEL, "m/s^2", "accelerometer", "velocity"),
    TEMPERATURE,
)
TABLE_CHANNELS = (
    Channel("angle", "angle", "angle", MAX_TABLE_ANGLE, "rad", "table angle"),
    Channel("rate", "rate", "rate", MAX_TABLE_RATE, "rad/s", "table rate", optional=True),
)
REFERENCE_CHANNELS = (
    Channel("latitude", "latitude", "angle", 0.5 * math.pi, "rad", "latitude", optional=True),
    Channel("longitude", "longitude", "angle", 2.0 * math.pi, "rad", "longitude", optional=True),
    Channel("height", "height", "length", MAX_HEIGHT, "m", "height of a vehicle", optional=True),
    *(
        Channel(name, name, "velocity", MAX_SPEED, "m/s", "velocity of a vehicle", optional=True)
        for name in ("v_east", "v_north", "v_up")
    ),
)

OPTIONAL = tuple(channel for channel in IMU_CHANNELS if channel.optional)
AXES = tuple(channel.name for channel in IMU_CHANNELS if not channel.optional)
BY_NAME = {c.name: c for c in (*IMU_CHANNELS, *TABLE_CHANNELS, *REFERENCE_CHANNELS)}
