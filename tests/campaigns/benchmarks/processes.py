"""Processes: `rotcli navigate` next to a script with pyins that does the same.

An error-free log of a table turning about a horizontal axis at 100 deg/s, in increments: import,
read the Parquet log, integrate 300 s, take the errors, write the solution.
"""

import json
import subprocess
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from rotcli.logs.table import read_table
from rotcli.models import rotation
from rotcli.rig.rig import read_rig
from rotcli.units import DEG
from tests.campaigns.benchmarks import peers
from tests.campaigns.benchmarks.logs import scenario
from tests.campaigns.benchmarks.measure import (
    PYTHON,
    ROTCLI,
    Figure,
    Row,
    Settings,
    compared,
    one,
    side_by_side,
)

_SCRIPT = str(Path(__file__).with_name("peers") / "navigate_with_pyins.py")
_START, _END = 62.0, 362.0
_SCENARIO = """\
profile = "ideal"
encoder_step = 0.0
site = { latitude = 51.08, longitude = -114.13, height = 0.0 }
table = { axis = "x" }
imu = { sampling = "increment" }
leg = [
  { duration = 60, rate = 0.0, stage = "static" },
  { duration = 302, rate = 100.0, stage = "navigation" },
]
"""


def rows(settings: Settings) -> Iterator[Row]:
    """Time, memory and the error of the height."""
    folder = scenario(settings.folder / "horizontal", _SCENARIO)
    imu, table = folder / "imu.parquet", folder / "table.parquet"
    ours = [*ROTCLI, "navigate", str(imu), str(table), "--mode", "conventional", "--quiet"]
    ours += ["--window", f"{_START}:{_END}", "-o", str(folder / "navigation.json")]
    ours += ["--solution", str(folder / "solution.parquet")]
    what = "read, integrate 300 s, write"
    if peers.missing("pyins"):
        yield one(what, side_by_side({"ours": ours}, settings.rounds)["ours"])
        yield Row(what, peer="pyins", note="skipped: not installed")
        return
    theirs = [PYTHON, _SCRIPT, str(imu), str(folder / "pyins.parquet"), *_pyins_start(folder)]
    commands = {"ours": ours, "pyins": theirs}
    found = side_by_side(commands, settings.slow_rounds, warm=not settings.quick)
    yield compared(what, found["ours"], "pyins", found["pyins"], at_most=0.2)

    navigation = json.loads((folder / "navigation.json").read_text(encoding="utf-8"))
    mine = navigation["max"]["height_m"]
    done = subprocess.run(theirs, capture_output=True, text=True, check=True)
    height = float(done.stdout)
    yield Row(
        "largest error of the height",
        Figure.of([mine], "m"),
        "pyins",
        Figure.of([height], "m"),
        Figure.of([mine / height], ""),
        at_most=1e-4,
        bound_on="rotcli",
    )


def _pyins_start(folder: Path) -> list[str]:
    """Return the arguments of the script: window, site, and the sensor's attitude there."""
    from pyins.transform import mat_to_rph

    table = read_table(folder / "table.parquet", read_rig(folder / "rig.toml"))
    angle = float(np.interp(_START, table.time, table.angle))
    C_ns = rotation.axis_rotation(np.array(rotation.UNIT_VECTORS["x"]), angle)
    angles = mat_to_rph(peers.ENU_TO_NED @ C_ns)
    site = [peers.LATITUDE / DEG, peers.LONGITUDE / DEG, peers.HEIGHT]
    return [repr(float(value)) for value in (_START, _END, *site, *angles)]


def expected(settings: Settings) -> Iterator[Row]:
    """CPU time of the expected errors and their tests in one run at 100 deg/s."""
    from rotcli.models.expected.companions import block_residuals
    from rotcli.models.expected.errors import expected_errors
    from rotcli.models.expected.statistics import expected_statistics
    from rotcli.models.numerics.remembered import forget
    from tests.models.expected.runs import run

    table, blocks, gyro, accel = run("NAV440", "full", 100.0)
    sigma, seconds = np.full(3, 1e-3), int(blocks.duration)
    means = 1e-5 * np.random.default_rng(1).standard_normal((seconds, 3))
    rate = np.full(seconds, blocks.rate[0])

    def assess(axes: int) -> None:
        forget()  # what the runs of one plan share
        figures = [replace(gyro.axes[0], white=k * gyro.axes[0].white) for k in (1.0, 1.1, 1.2)]
        source = replace(gyro, axes=tuple(figures[:axes]))
        found = expected_statistics(expected_errors(table, blocks, source, accel, sigma))
        found.p_values(found.rms)
        block_residuals(means, blocks.start, 1.0, rate, source)
        block_residuals(means, blocks.start, 1.0, rate, accel)

    for axes, what in ((1, "the same figures"), (3, "figures of each gyro")):
        measured = side_by_side({"ours": partial(assess, axes)}, settings.rounds)["ours"]
        yield one(f"expected errors of a run of 300 s, {what}", measured, at_most=0.05)
