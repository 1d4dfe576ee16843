"""The text formats of vendors and other programs that `[imu] format` names, in one table.

A rig describes one of its own with the same words: `columns` (by name, or counted from 1),
`units`, `delimiter`, `comment`, `skip`, `sampling`, `mount`; what it says goes before the table.
A log in rotcli's own columns is read as it is, whatever format the rig names: so a converted
log goes with the rig of the log it came from.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

AXES = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
Name = str | int  # of a column: its name, or its place counted from 1


@dataclass(frozen=True)
class Format:
    """A format: where it is described, and what a rig would say of it.

    sign: what the first lines of such a file match, to tell a user who named no format.
    ticks: columns that count instead of telling the time, the first that is filled is taken.
    """

    title: str
    source: str
    columns: Mapping[str, Name]
    units: Mapping[str, str] = field(default_factory=dict)
    delimiter: str | None = None
    comment: str = ""
    skip: int = 0
    figures: int = 0
    sampling: str | None = None
    mount: tuple[tuple[float, float, float], ...] | None = None
    sign: str | None = None
    ticks: tuple["Ticks", ...] = ()


@dataclass(frozen=True)
class Ticks:
    """A column that counts time: where it wraps; counts per s, None for one count a sample."""

    column: str
    wrap: int
    rate: float | None = None


def _named(*names: Name) -> dict[str, Name]:
    return dict(zip(("time", *AXES), names, strict=True))


FORMATS: dict[str, Format] = {
    "xsens": Format(
        title="Xsens MT Manager ASCII export",
        # Counters: "MT Low Level Communication Protocol", MT0101P: SampleTimeFine in ticks of
        # 10 kHz, 32 bits; PacketCounter 16 bits. Units: MTi User Manual, MT0605P.
        source="Xsens MT0101P, MT0605P",
        columns=_named("SampleTimeFine", *(f"{s}_{a}" for s in ("Gyr", "Acc") for a in "XYZ")),
        units={"gyro": "rad/s", "accel": "m/s^2"},
        comment="//",
        sign=r"(?m)\A//|^PacketCounter\b",
        ticks=(Ticks("SampleTimeFine", 1 << 32, 1e4), Ticks("PacketCounter", 1 << 16)),
    ),
    "euroc": Format(
        title="EuRoC MAV dataset, imu0/data.csv",
        # Burri et al., "The EuRoC micro aerial vehicle datasets", IJRR 2016: the header line
        # carries the units, the stamps are ns of Unix time.
        source="Burri et al., IJRR 2016",
        columns=_named("timestamp", *(f"{s}_RS_S_{a}" for s in ("w", "a") for a in "xyz")),
    ),
    "kf-gins": Format(
        title="KF-GINS increments text",
        # github.com/i2Nav-WHU/KF-GINS, README, 2.2 "Data format" and 2.1 "Frame definition": the
        # IMU's axes point forward, right, down.
        source="github.com/i2Nav-WHU/KF-GINS, README 2.1, 2.2",
        columns=_named(1, 2, 3, 4, 5, 6, 7),
        units={"time": "s", "gyro": "rad", "accel": "m/s"},
        delimiter=" ",
        sampling="increment",
        mount=((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    ),
    "psins": Format(
        title="PSINS .imu text",
        # Yan Gongmin, PSINS toolbox, imufile.m: three lines of figures, then integer increments.
        # The seventh column, if any, is written in us, though its header comment says ms.
        source="PSINS toolbox, imufile.m",
        columns=dict(zip(AXES, range(1, 7), strict=True)),
        units={"gyro": "rad", "accel": "m/s"},
        delimiter=" ",
        comment="%",
        figures=3,
        sampling="increment",
        sign=r"\A%.*PSINS",
    ),
}


def implied(imu: Mapping[str, Any]) -> dict[str, Any]:
    """Return [imu] keys with what their format settles: what a sample means, and the mount."""
    named = FORMATS.get(str(imu.get("format")))
    settled = {} if named is None else {"sampling": named.sampling, "mount": named.mount}
    return {**{key: value for key, value in settled.items() if value is not None}, **imu}
