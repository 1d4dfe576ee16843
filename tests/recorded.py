"""Recorded logs for tests, read where they are; tests skip where they are absent.

`ROTCLI_SHARED` names the folder with `data` and `cases`; the default is `shared` next to the clone.
"""

import os
from pathlib import Path

import pytest

SHARED = Path(os.environ.get("ROTCLI_SHARED", Path(__file__).parents[2] / "shared"))
# The rig of the recorded Xsens MTi: gravity is given with the recording, the place is assumed.
XSENS_RIG = """
[site]
latitude = 45.41
longitude = 11.88
height = 12.0
gravity = 9.81744

[imu]
name = "Xsens MTi"
sampling = "instant"
"""
# A rig that says all there is to say of it: no command has anything to add.
XSENS_COMPLETE_RIG = (
    XSENS_RIG
    + "angle_random_walk = 3.0\nvelocity_random_walk = 0.12\nbias_instability = 24.0\n"
    + "accel_bias_instability = 0.0005\n"
    + "[attitude]\npitch = 0.742\nroll = 0.278\nazimuth = 0.0\n"
)
XSENS_LOG = ("data", "xsens_mti_multiposition.csv")
_XSENS_STILL_TIME = 51.5  # s; the IMU is still on a desk up to here


def shared(*parts: str) -> Path:
    """Return a recorded file or folder; skip the test where it is absent."""
    path = SHARED.joinpath(*parts)
    if "*" in path.name:  # a pattern of one name
        path = next(path.parent.glob(path.name), path)
    if not path.exists():
        pytest.skip(f"no recorded data at {path} (ROTCLI_SHARED)")
    return path


def downloaded(*parts: str) -> Path:
    """Return a recorded file that `make recorded` downloads; skip the test where it is absent."""
    path = Path(__file__).parents[1].joinpath("build", "recorded", "tests", "data", *parts)
    if not path.exists():
        pytest.skip("no recorded logs of other devices (make recorded)")
    return path


def write_xsens_still(folder: Path) -> Path:
    """Write the still part of the recorded Xsens MTi and its rig.toml; return the log."""
    lines = shared(*XSENS_LOG).read_text().splitlines(keepends=True)
    rows = [line for line in lines[1:] if float(line.split(",", 1)[0]) <= _XSENS_STILL_TIME]
    log = folder / "xsens_still.csv"
    log.write_text("".join([lines[0], *rows]))
    (folder / "rig.toml").write_text(XSENS_RIG)
    return log
