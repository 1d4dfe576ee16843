"""Time and peak memory against the length of the log, and the exponents of both.

`time = start + a length^p`: the start (bare imports, measured in the same rounds) is taken off
before p is fitted; memory is fitted as it is.
"""

from collections.abc import Iterator
from pathlib import Path
from statistics import median

import numpy as np

from tests.campaigns.benchmarks.logs import scenario, still_log
from tests.campaigns.benchmarks.measure import (
    PYTHON,
    ROTCLI,
    Figure,
    Row,
    Settings,
    one,
    side_by_side,
)

# An error-free IMU: with real errors an unaided day ends anywhere on the globe.
_SCENARIO = """\
profile = "ideal"
leg = [
  {{ duration = 60, rate = 0.0, stage = "static" }},
  {{ duration = {turning}, rate = 10.0, stage = "rotation" }},
]
"""
# Name: options. {log} is the folder of the log, {start} and {end} its turning segment.
COMMANDS = {
    "calibrate": "calibrate {log}/imu.parquet {log}/table.parquet -o {log}/calibration.json",
    "navigate": "navigate {log}/imu.parquet {log}/table.parquet --mode conventional "
    "--height hold --window {start}:{end} -o {log}/navigation.json",
    "observe": "observe {log}/imu.parquet {log}/table.parquet -o {log}/observe.json",
    "allan": "allan {log}/still.parquet -o {log}/allan.json",
}
TIME_AT_MOST, MEMORY_AT_MOST = 1.1, 0.2
_BARE = "import numpy, pyarrow.parquet, click"
_GIGABYTES_48 = 2e9


def rows(settings: Settings) -> Iterator[Row]:
    """Measure logs of an hour to two days; of minutes with --quick."""
    hours = [0.25, 1.0] if settings.quick else [1.0, 2.0, 4.0, 8.0, 24.0, 48.0]
    rounds = 1 if settings.quick else 3
    logs = {length: _log(settings.folder, length) for length in hours}
    for name, template in COMMANDS.items():
        times, peaks = [], []
        bare = side_by_side({"bare": [PYTHON, "-c", _BARE]}, 3)["bare"]
        for length, (log, start, end) in logs.items():
            command = [*ROTCLI, *template.format(log=log, start=start, end=end).split()]
            # What takes its time is measured once.
            run = side_by_side(
                {"ours": [*command, "--quiet"]}, rounds if length <= 2.0 else 1, warm=False
            )["ours"]
            times.append(median(run.seconds) - median(bare.seconds))
            peaks.append(run.peak)
            yield one(f"rotcli {name}, a log of {length:g} h", run)
            if length == 48.0:
                peak = Figure.of([run.peak / 1e9], "GB")
                what = f"rotcli {name}, peak memory at 48 h"
                yield Row(what, peak, at_most=_GIGABYTES_48 / 1e9, bound_on="rotcli")
        yield _exponent(f"rotcli {name}, exponent of time", hours, times, TIME_AT_MOST)
        at_most = None if settings.quick else MEMORY_AT_MOST
        yield _exponent(f"rotcli {name}, exponent of memory", hours, peaks, at_most)


def _log(folder: Path, hours: float) -> tuple[Path, float, float]:
    """Play a log of some hours, turning except for the first minute; return where it turns.

    There is a still and noisy one as well, for the Allan deviation.
    """
    turning = hours * 3600.0 - 61.0
    name = f"hours{hours:g}".replace(".", "_")
    log = scenario(folder / name, _SCENARIO.format(turning=turning))
    still_log(log / "still.parquet", hours)
    return log, 62.0, 60.0 + turning


def _exponent(what: str, hours: list[float], values: list[float], at_most: float | None) -> Row:
    """Return the row of p in `value = a hours^p`, fitted over all lengths."""
    exponent = float(np.polyfit(np.log(hours), np.log(values), 1)[0])
    return Row(what, Figure.of([exponent], ""), at_most=at_most, bound_on="rotcli")
