"""The rig: one description of the set-up (rig.toml) as frozen settings in SI and radians.

`read_rig` reads the file, `rig_from_dict` the same keys from a JSON result, `default_rig` is
used when there is no file; `Rig.override` lays command-line options on top. `Rig.effective` is the
way back: the file's own keys and units. The keys are defined in `rotcli.rig.keys`.
"""

import re
from collections.abc import Mapping
from dataclasses import field, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import RigError
from rotcli.files.formats import Column
from rotcli.files.text import parse_toml, read_text
from rotcli.files.toml_schema import Pair
from rotcli.rig.keys import (
    KEYS,
    MOUNTING_KEYS,
    format_defaults,
    parse_mountings,
    parse_sections,
)
from rotcli.rig.values import to_file_units
from rotcli.units import DEG, FloatArray

Figure = float | tuple[float, float, float]  # one number for all three axes, or one for each
Sampling = Literal["instant", "average", "increment"]


class _ByValue:
    """Equality of settings that hold arrays."""

    def __eq__(self, other: object) -> bool:
        if type(self) is not type(other):
            return NotImplemented
        return all(
            bool(np.array_equal(getattr(self, f.name), getattr(other, f.name)))
            for f in fields(self)  # type: ignore[arg-type]
        )

    __hash__ = None  # type: ignore[assignment]


@dataclass(frozen=True)
class Site:
    """Place of the table: rad, rad, m; gravity (m/s^2) is None for normal gravity."""

    latitude: float
    longitude: float = 0.0
    height: float = 0.0
    gravity: float | None = None
    gravity_sigma: float | None = None


# The papers' laboratory, near Calgary (R16 section 4; the height is ours): where no site is named.
DEFAULT_SITE = Site(latitude=51.08 * DEG, longitude=-114.13 * DEG, height=1100.0)


@dataclass(frozen=True)
class Attitude:
    """Attitude of the body frame against East-North-Up at the start, rad; None where unknown.

    The sigmas (rad) say how well the table was levelled and aligned.
    """

    pitch: float | None = None
    roll: float | None = None
    azimuth: float | None = None
    pitch_sigma: float | None = None
    roll_sigma: float | None = None
    azimuth_sigma: float | None = None


@dataclass(frozen=True, eq=False)
class Mounting(_ByValue):
    """One mounting of the IMU on the table: start, end (s) on the log's clock.

    mount: (3, 3), rows are the sensor axes in the mounting frame. sigma: rad, of each of its
    three angles; None where they are not known at all, 0 for an exact one.
    """

    start: float
    end: float
    mount: FloatArray
    sigma: float | None = None


@dataclass(frozen=True, eq=False)
class LogSettings(_ByValue):
    """How a log is written; None and empty where the file itself shows it.

    format: a name of `rotcli.files.formats`. columns: channel to the name of its column, to its
    number from 1, or for `time` to two columns. units, scale, offset: by group of channels (gyro,
    accel, angle …); a reading is (raw - offset) * scale in the unit. clock: regular (even clock
    behind jittering stamps), stamps (as logged) or count (no record was lost). rate: Hz, of logs
    without time. delimiter, decimal, comment, skip, encoding: of text. instance: which IMU of
    several in one log. topic: of a ROS bag.
    """

    format: str | None = None
    columns: dict[str, Column | tuple[Column, Column]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    scale: dict[str, float] = field(default_factory=dict)
    offset: dict[str, float] = field(default_factory=dict)
    clock: Literal["regular", "stamps", "count"] = "regular"
    rate: float | None = None
    delimiter: str | None = None
    decimal: str | None = None
    comment: str | None = None
    skip: int | None = None
    encoding: str | None = None
    instance: int | str | None = None
    topic: str | None = None


@dataclass(frozen=True, eq=False)
class ImuSettings(LogSettings):
    """The IMU: what its samples mean, its noise figures, how it is mounted.

    angle_random_walk rad/sqrt(s), bias_instability rad/s, velocity_random_walk m/s/sqrt(s),
    accel_bias_instability m/s^2, rate_random_walk rad/s/sqrt(s), gauss_markov sigmas rad/s and
    m/s^2, times s, scale_sigma a fraction (of the gyros' uncalibrated scale factor and
    installation), turn_on_sigma rad/s (change of a gyro bias from one log to another),
    accel_bias_sigma m/s^2 (of an uncalibrated accelerometer): each
    one number or one for each axis. gyro_range rad/s, accel_range m/s^2.
    mount: (3, 3), rows are the IMU's axes in the mounting frame, so v_s = mount.T @ reading.
    lever_arm: (3,) m, from the rotation axis to the IMU in the IMU's own axes.
    reports_gravity: the accelerometers read gravity, -g upward, not specific force. channels:
    those that the log contains, where some are missing. accel_log: file of the accelerometers.
    """

    name: str | None = None
    sampling: Sampling = "instant"
    angle_random_walk: Figure | None = None
    bias_instability: Figure | None = None
    velocity_random_walk: Figure | None = None
    accel_bias_instability: Figure | None = None
    rate_random_walk: Figure | None = None
    gauss_markov_gyro_sigma: Figure | None = None
    gauss_markov_gyro_time: Figure | None = None
    gauss_markov_accel_sigma: Figure | None = None
    gauss_markov_accel_time: Figure | None = None
    scale_sigma: Figure | None = None
    turn_on_sigma: Figure | None = None
    accel_bias_sigma: Figure | None = None
    gyro_range: float | None = None
    accel_range: float | None = None
    mount: FloatArray = field(default_factory=lambda: np.eye(3))
    lever_arm: FloatArray = field(default_factory=lambda: np.zeros(3))
    reports_gravity: bool = False
    channels: tuple[str, ...] = ()
    accel_log: str | None = None

    def figure(self, name: str) -> FloatArray | None:
        """Return a noise figure as one number for each axis (3,), or None where not given."""
        value: Figure | None = getattr(self, name)
        return None if value is None else np.array(np.broadcast_to(value, 3), dtype=float)


@dataclass(frozen=True, eq=False)
class TableSettings(LogSettings):
    """The table: rotation axis (3,) in the body frame, the sense and source of its angle.

    column: that of the angle (or rate). quantity: what the column contains. counts_per_turn: of
    an encoder that is logged in counts. wrap: rad, where the angle starts again, None for a full
    turn. time_offset: s, added to its times. clock_rate: fraction by which its times since the
    first record are too short. axes, directions: of a table with several axes, outermost first.
    """

    axis: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    axes: tuple[FloatArray, ...] = ()
    direction: int = 1
    directions: tuple[int, ...] = ()
    column: Column = "angle"
    quantity: Literal["angle", "rate"] | None = None
    counts_per_turn: float | None = None
    wrap: float | None = None
    time_offset: float = 0.0
    clock_rate: float = 0.0

    @property
    def axis_name(self) -> str:
        """`x`, `y` or `z`, or `u` for any other unit vector."""
        for name, unit in zip("xyz", np.eye(3), strict=True):
            if np.array_equal(self.axis, unit):
                return name
        return "u"


@dataclass(frozen=True)
class Stages:
    """Named segments of the log, s on its own clock; None or empty where to be found."""

    static: Pair | None = None
    rotation: tuple[Pair, ...] = ()
    navigation: Pair | None = None


@dataclass(frozen=True)
class Rig:
    """The set-up; `path` is the file it came from, or None."""

    path: str | None = None
    site: Site | None = None
    attitude: Attitude = field(default_factory=Attitude)
    imu: ImuSettings = field(default_factory=ImuSettings)
    table: TableSettings = field(default_factory=TableSettings)
    reference: LogSettings = field(default_factory=LogSettings)
    unit: dict[str, Any] = field(default_factory=dict)
    stages: Stages = field(default_factory=Stages)
    mountings: tuple[Mounting, ...] = ()

    @property
    def lever_arm_s(self) -> FloatArray:
        """The lever arm (3,) m in the sensor frame s, that is after the mounting rotation."""
        return self.imu.mount.T @ self.imu.lever_arm

    def effective(self) -> dict[str, Any]:
        """Return the settings as rig.toml contains them: its keys, its units, only those set."""
        result: dict[str, Any] = {}
        for section, keys in KEYS.items():
            settings = getattr(self, section)
            present = {} if settings is None else {k: getattr(settings, k, None) for k in keys}
            if section == "table" and self.table.axis_name != "u":
                present["axis"] = self.table.axis_name
            if section != "imu" and present.get("clock") == "regular":
                del present["clock"]
            values = {k: to_file_units(keys[k], v) for k, v in present.items() if _is_set(v)}
            if values:
                result[section] = values
        if self.unit:
            result["unit"] = dict(self.unit)
        if self.mountings:
            result["mountings"] = [_mounting_to_file(m) for m in self.mountings]
        return result

    def override(self, changes: Mapping[str, Mapping[str, Any]]) -> "Rig":
        """Return the rig with some keys replaced; keys, units and checks are the file's own.

        >>> default_rig().override({"table": {"axis": "x"}}).table.axis_name
        'x'
        """
        merged = self.effective()
        for section, values in changes.items():
            # A format laid on top brings what it settles along.
            if section == "mountings":
                merged[section] = values
                continue
            laid = format_defaults(values) if section == "imu" else values
            merged[section] = {**merged.get(section, {}), **laid}
            if section == "table" and "column" not in laid and "angle" in laid.get("columns", {}):
                del merged[section]["column"]  # both name the column of the angle
        return rig_from_dict(merged, self.path)


def _mounting_to_file(m: Mounting) -> dict[str, Any]:
    """Return one mounting as rig.toml would contain it."""
    values = {"from": m.start, "to": m.end, "mount": m.mount, "sigma": m.sigma}
    return {k: to_file_units(MOUNTING_KEYS[k], v) for k, v in values.items() if v is not None}


def _is_set(value: object) -> bool:
    return (
        value is not None
        and value is not False
        and not (isinstance(value, dict | tuple | list) and len(value) == 0)
    )


def default_rig() -> Rig:
    """Return the settings that hold when there is no rig.toml."""
    return Rig()


def rig_from_dict(values: Mapping[str, Any], path: str | None = None) -> Rig:
    """Return the rig that a dictionary with rig.toml's sections, keys and units describes.

    Raises RigError for an unknown key or an impossible value.
    """
    sections = parse_sections(values, path or "rig")
    return Rig(
        path=path,
        site=Site(**sections["site"]) if "site" in sections else None,
        attitude=Attitude(**sections.get("attitude", {})),
        imu=ImuSettings(**sections.get("imu", {})),
        table=TableSettings(**sections.get("table", {})),
        reference=LogSettings(**sections.get("reference", {})),
        unit=sections.get("unit", {}),
        stages=Stages(**sections.get("stages", {})),
        mountings=tuple(
            Mounting(m["from"], m["to"], m["mount"], m.get("sigma"))
            for m in parse_mountings(values.get("mountings", []), path or "rig")
        ),
    )


def read_rig(path: str | Path) -> Rig:
    """Read rig.toml.

    Raises RigError when the file cannot be read, is not TOML, or contains an unknown key or an
    impossible value; the text names the file, the key, the value and what is allowed.
    """
    name = str(path)
    try:
        text = read_text(path)
    except OSError as error:
        raise RigError(f"{name}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise RigError(f"{name}: not UTF-8 text (byte {error.start}); save it as UTF-8") from error
    try:
        values = parse_toml(text)
    except ValueError as error:
        found = re.search(r"^(.*?)\s*\(at line (\d+), column (\d+)\)", str(error), re.DOTALL)
        if found:
            where, what = f"line {found[2]}, column {found[3]}: ", found[1]
        else:
            where, what = "", " ".join(str(error).split())
        raise RigError(f"{name}: {where}not TOML: {what}; correct the file") from error
    return rig_from_dict(values, name)
