"""Usual column names of IMU, table and reference logs.

A triad is found when three columns differ in their axis only (x, y, z; 0, 1, 2; 1, 2, 3) and the
rest of the name is one of the usual words. A name with a unit at its end (`gyro_x_dps`) has it.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from rotcli.units import UNITS


def _words(text: str) -> tuple[str, ...]:
    return tuple(text.split())


GYRO_WORDS = [
    "gyro",
    "gyros",
    "gyroscope",
    "gyroscopes",
    "gyr",
    "w",
    "g",
    "wx",
    "omega",
    "om",
    "angular_velocity",
    "angularvelocity",
    "ang_vel",
    "angvel",
    "angular_rate",
    "angularrate",
    "ang_rate",
    "angrate",
    "rotation_rate",
    "rotationrate",
    "rotational_rate",
    "rate_of_turn",
    "rot_rate",
    "gyro_rate",
    "gyrorate",
    "gyro_rad",
    "gyr_rad",
    "delta_angle",
    "delta_theta",
    "dtheta",
    "deltaangle",
    "del_ang",
    "delang",
    "dang",
    "w_rs_s",
    "rad",
    "body_rate",
    "uncomp_gyro",
    "uncompgyro",
    "imu_gyro",
    "gy",
    "ang_v",
    "angular_speed",
    "imu_angular_velocity",
    "gyroxyz",
    "angular_vel",
    "gyro_raw",
    "gyr_raw",
    "raw_gyro",
    "gyro_data",
    "angular_velocities",
    "ar",
    "ars",
]
ACCEL_WORDS = [
    "accel",
    "accels",
    "accelerometer",
    "accelerometers",
    "acceleration",
    "acc",
    "a",
    "f",
    "specific_force",
    "specificforce",
    "linear_acceleration",
    "linearacceleration",
    "lin_acc",
    "linacc",
    "lin_accel",
    "linear_accel",
    "sf",
    "fb",
    "acceleration_m_s2",
    "accelerometer_m_s2",
    "delta_velocity",
    "deltavelocity",
    "delta_vel",
    "delvel",
    "deltav",
    "dv",
    "a_rs_s",
    "uncomp_accel",
    "uncompaccel",
    "imu_accel",
    "imu_acc",
    "imu_linear_acceleration",
    "accel_raw",
    "acc_raw",
    "raw_accel",
    "raw_acc",
    "ac",
    "accel_data",
    "acceler",
    "body_accel",
]
# Words for readings that are not those of the sensor: a triad of them is never taken.
_DERIVED = re.compile(r"free|user|gravity|bias|cov|std|sigma|mag|ref|var|orient|quat|earth|sync")

TIME_NAMES = [
    "time",
    "t",
    "timestamp",
    "time_stamp",
    "stamp",
    "times",
    "timestamps",
    "time_s",
    "time_sec",
    "t_s",
    "seconds",
    "time_seconds",
    "elapsed",
    "elapsed_time",
    "time_usec",
    "time_us",
    "timeus",
    "timestamp_us",
    "timestamp_ns",
    "timestamp_ms",
    "time_ms",
    "time_ns",
    "timestamp_s",
    "epoch",
    "unix_time",
    "unixtime",
    "ros_time",
    "rostime",
    "header_stamp",
    "field_header_stamp",
    "stamp_s",
    "datetime",
    "date_time",
    "utc",
    "utc_time",
    "utctime",
    "date",
    "gps_time",
    "gpstime",
    "gps_tow",
    "tow",
    "gps_sow",
    "sow",
    "seconds_of_week",
    "gps_seconds",
    "rosbagtimestamp",
    "sample_time",
    "sampletime",
    "timestartup",
    "time_startup",
    "millis",
    "micros",
    "time_of_week",
    "system_time",
    "host_time",
    "sensor_time",
    "sampletimefine",
    "clock",
    "zeit",
    "ts",
    "time_boot_ms",
    "timeboot",
    "arrival_time",
    "logging_time",
    "loggingtime",
]
SECOND_NAMES = _words(
    "sec secs stamp_sec header_stamp_sec stamp_secs header_stamp_secs field_header_stamp_sec "
    "field_header_stamp_secs time_sec t_sec s"
)
NANOSECOND_NAMES = [
    "nanosec",
    "nanosecs",
    "nsec",
    "nsecs",
    "ns",
    "nanoseconds",
    "stamp_nanosec",
    "stamp_nsec",
    "stamp_nsecs",
    "header_stamp_nanosec",
    "header_stamp_nsec",
    "header_stamp_nsecs",
    "field_header_stamp_nsec",
    "field_header_stamp_nsecs",
    "time_nsec",
    "t_nsec",
]
WEEK_NAMES = ("week", "gps_week", "gpsweek", "week_number", "gnss_week", "wn")
WEEK_SECOND_NAMES = [
    "gps_tow",
    "tow",
    "gps_sow",
    "sow",
    "seconds_of_week",
    "gps_seconds",
    "week_seconds",
    "seconds",
    "time_of_week",
    "gps_time_of_week",
    "sec_of_week",
    "secs",
    "gps_sec",
    "sow_s",
    "tow_s",
]
COUNTER_NAMES = [
    "sample",
    "samples",
    "n_samples",
    "sample_number",
    "sample_no",
    "sampleno",
    "sample_index",
    "sample_id",
    "packet_number",
    "packet_counter",
    "packetcounter",
    "packet",
    "counter",
    "count",
    "index",
    "idx",
    "seq",
    "sequence",
    "frame",
    "frame_number",
    "record",
    "record_number",
    "row",
    "number",
    "no",
    "nr",
    "n",
    "i",
    "id",
    "tick",
    "ticks",
]
INSTANCE_NAMES = [
    "i",
    "instance",
    "imu",
    "imu_id",
    "imuid",
    "imu_index",
    "sensor",
    "sensor_id",
    "sensorid",
    "device",
    "device_id",
    "unit",
    "multi_id",
]
TEMPERATURE_NAMES = [
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
]
ANGLE_NAMES = [
    "angle",
    "position",
    "pos",
    "angle_deg",
    "position_deg",
    "table_angle",
    "encoder",
    "encoder_angle",
    "theta",
    "angle_rad",
    "actual_position",
    "act_pos",
    "pos_act",
    "table_position",
    "enc",
    "encoder_position",
    "winkel",
    "rotation",
    "azimuth",
    "encoder_counts",
    "encoder_count",
    "counts",
    "position_counts",
    "rate_table_angle",
    "axis_angle",
    "axis_position",
]
RATE_NAMES = [
    "rate",
    "speed",
    "velocity",
    "angular_velocity",
    "table_rate",
    "angular_rate",
    "rate_dps",
    "omega",
    "angular_speed",
    "actual_velocity",
    "actual_rate",
    "act_vel",
    "vel",
    "rpm",
    "table_speed",
    "axis_rate",
]
_ENDINGS = {
    "dps": "deg/s",
    "deg_s": "deg/s",
    "degs": "deg/s",
    "deg_per_s": "deg/s",
    "degps": "deg/s",
    "deg_sec": "deg/s",
    "mdps": "mdeg/s",
    "rad_s": "rad/s",
    "rads": "rad/s",
    "radps": "rad/s",
    "rad_sec": "rad/s",
    "rad_per_s": "rad/s",
    "dph": "deg/h",
    "deg_h": "deg/h",
    "rpm": "rpm",
    "mps2": "m/s^2",
    "m_s2": "m/s^2",
    "ms2": "m/s^2",
    "mpss": "m/s^2",
    "m_s_2": "m/s^2",
    "m_per_s2": "m/s^2",
    "m_s_s": "m/s^2",
    "g": "g",
    "mg": "mg",
    "ug": "ug",
    "deg": "deg",
    "degrees": "deg",
    "rad": "rad",
    "arcsec": "arcsec",
    "mps": "m/s",
    "m_s": "m/s",
    "s": "s",
    "sec": "s",
    "ms": "ms",
    "us": "us",
    "usec": "us",
    "ns": "ns",
    "nsec": "ns",
    "min": "min",
    "degc": "degC",
    "deg_c": "degC",
    "celsius": "degC",
    "c": "degC",
    "degf": "degF",
    "k": "K",
    "kelvin": "K",
    "m": "m",
}


def plain_name(name: str) -> str:
    """Return a name in lower case with single underscores.

    >>> plain_name("Gyro X"), plain_name("angularVelocity.x"), plain_name("TimeUS")
    ('gyro_x', 'angular_velocity_x', 'time_us')
    """
    split = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name.strip())
    split = re.sub(r"(?<=[A-Z])(?=[A-Z][a-z])", "_", split)
    return re.sub(r"[^a-z0-9]+", "_", split.lower()).strip("_")


def unit_in_name(name: str, *kinds: str) -> tuple[str, str | None]:
    """Return a plain name without the unit at its end, and the unit where there is one.

    >>> unit_in_name("gyro_x_dps", "rate"), unit_in_name("accel_z", "acceleration")
    (('gyro_x', 'deg/s'), ('accel_z', None))
    """
    for ending in sorted(_ENDINGS, key=len, reverse=True):
        unit = _ENDINGS[ending]
        if name.endswith(f"_{ending}") and any(unit in UNITS[kind] for kind in kinds):
            return name[: -len(ending) - 1], unit
    return name, None


@dataclass(frozen=True)
class Triad:
    """Three columns x, y, z of one sensor: their indices, and the word they share."""

    columns: tuple[int, int, int]
    word: str
    unit: str | None = None


_SHORT_WORD = 2  # letters; a longer word is recognised with words before it
_AXES = (("x", "y", "z"), ("0", "1", "2"), ("1", "2", "3"))
_KINDS = {"gyro": ("rate", "angle"), "accel": ("acceleration", "velocity")}


def find_triads(names: Sequence[str], sensor: str) -> list[Triad]:
    """Return the triads of a sensor (`gyro` or `accel`) among column names, the best first."""
    groups: dict[tuple[str, str], dict[str, int]] = {}
    about: dict[tuple[str, str], tuple[int, str | None]] = {}
    for k, raw in enumerate(names):
        plain = plain_name(raw)
        bare, unit = unit_in_name(plain, *_KINDS[sensor])
        for candidate, own in dict.fromkeys(((bare, unit), (plain, None))):
            for word, axis, shape in _splits(candidate):
                rank = _rank(word, sensor)
                if rank is not None:
                    groups.setdefault((word, shape), {}).setdefault(axis, k)
                    about.setdefault((word, shape), (rank, own))
    found = []
    for (word, shape), axes in groups.items():
        for letters in _AXES:
            if set(letters) == set(axes):
                x, y, z = (axes[letter] for letter in letters)
                rank, own = about[word, shape]
                found.append((rank, x, Triad((x, y, z), word, own)))
    unique: dict[tuple[int, int, int], Triad] = {}
    for _, _, triad in sorted(found, key=lambda item: item[:2]):
        unique.setdefault(triad.columns, triad)
    return list(unique.values())


def _rank(word: str, sensor: str) -> int | None:
    """Return how usual a word is for a sensor (0 first), None where it is none of its words.

    A number of an IMU and words before are allowed: `imu0_gyro`, `data_angular_velocity`.
    """
    words = GYRO_WORDS if sensor == "gyro" else ACCEL_WORDS
    if _DERIVED.search(word):
        return None
    bare = unit_in_name(word, *_KINDS[sensor])[0]
    for step, stem in enumerate((word, bare, re.sub(r"_?\d+(?=_|$)", "", word))):
        if stem in words:
            return words.index(stem) + step * len(words)
        for known in words:
            if len(known) > _SHORT_WORD and stem.endswith(f"_{known}"):
                return words.index(known) + (step + 3) * len(words)
    return None


def _splits(name: str) -> list[tuple[str, str, str]]:
    """Return the ways to split a plain name into word and axis."""
    found = []
    for pattern, shape in ((r"(.+?)_?([xyz0123])", "word first"), (r"([xyz])_(.+)", "axis first")):
        match = re.fullmatch(pattern, name)
        if match:
            word, axis = match.groups() if shape == "word first" else match.groups()[::-1]
            found.append((word.strip("_"), axis, shape))
    inner = re.fullmatch(r"(.+?)_([xyz])_(.+)", name)
    if inner:  # gyro_x_raw
        found.append((f"{inner[1]}_{inner[3]}", inner[2], "axis inside"))
    return found


def find_named(names: Sequence[str], known: Sequence[str], *kinds: str) -> int | None:
    """Return the index of the first column with a known name, None where there is none.

    A unit at the end of the name may be left out of the comparison.
    """
    plain = [plain_name(name) for name in names]
    bare = [unit_in_name(name, *kinds)[0] for name in plain]
    for wanted in known:
        for options in (plain, bare):
            if wanted in options:
                return options.index(wanted)
    return None
