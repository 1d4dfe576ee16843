"""CPU time of the parts of a navigation, each called alone; printed as JSON, s.

Reading: the rig, and both logs opened and read as `navigate` does, with the checks of columns,
units, sizes, clock and gaps. Kernel: the strapdown integration of the window. Writing: the
document with the hashes of the logs, checked, and written with fsync. Segments: those of the run,
its base and the still biases. Solution: its errors against the base, and their statistics. A batch
is asked to take little more than the first three for all five. Checks: of the log against its
table and itself. Assessment: the errors to expect and the tests of the residuals.
"""

import json
import sys
import time
from pathlib import Path
from statistics import median

import numpy as np

from rotcli.cli import loading
from rotcli.cli.batch.process import prepare_for_many_runs
from rotcli.files.channels import AXES
from rotcli.files.results.documents import document, write_result
from rotcli.logs.record import ImuLog
from rotcli.models.rotation import sum_rotated
from rotcli.models.sensors import correct
from rotcli.models.strapdown import InitialState, mechanize_log
from rotcli.navigate.api import NavigateOptions, prepare_navigation
from rotcli.navigate.assess import assess
from rotcli.navigate.estimate import Summary, navigate_chunks
from rotcli.navigate.place import Place
from rotcli.navigate.residuals import WindowMeans
from rotcli.rig.rig import Rig
from rotcli.run.alignment.checks import check_alignment
from rotcli.run.evidence.gravity import check_gravity
from rotcli.run.evidence.leaps import LEAP, check_leaps
from rotcli.run.evidence.records import check_record_interval
from rotcli.run.evidence.stillness import check_still
from rotcli.run.motion import encoder_noise, motion_between
from rotcli.run.recording import NavigationRun, check_turning

ASKED = ("reading", "kernel", "writing")
OF_THE_LOG = ("checks", "assessment")
_WARM = 2  # logs whose times do not count: what is loaded and computed on first use


class _Stopwatch:
    """CPU seconds of named parts, one of each for every log."""

    def __init__(self) -> None:
        self.seconds: dict[str, list[float]] = {}
        self._last = 0.0

    def start(self) -> None:
        """Begin a part."""
        self._last = time.process_time()

    def stop(self, part: str) -> None:
        """End a part."""
        self.seconds.setdefault(part, []).append(time.process_time() - self._last)


def navigate(folder: Path, output: Path, watch: _Stopwatch) -> None:
    """Navigate one log, conventional, part by part."""
    paths = str(folder / "imu.parquet"), str(folder / "table.parquet")
    watch.start()
    rig = loading.load_rig(None, paths[0])
    imu, table = loading.load_logs(*paths, rig, channels=AXES)
    watch.stop("reading")

    watch.start()
    prepared = prepare_navigation(imu, table, rig, None, NavigateOptions(("conventional",)))
    watch.stop("preparation")

    (run, place), removed = prepared.runs["conventional"], prepared.errors["conventional"]
    assert isinstance(imu, ImuLog)
    watch.start()
    _check(run, place, rig)
    watch.stop("checks")

    start = InitialState(place.latitude, 0.0, place.height, np.zeros(3), place.base.C_nb)
    watch.start()
    gyro = correct(removed.gyro, imu.gyro[run.window])
    mechanize_log(gyro, imu.accel[run.window], imu.interval, start)
    watch.stop("kernel")

    watch.start()
    summary = Summary("conventional", run.rate)
    for part in navigate_chunks(run, place, removed.gyro, removed.accel, mode="conventional"):
        summary.add(part)
    watch.stop("navigation")

    half = 0.5 * run.angle(run.window)
    turned = np.stack([np.cos(half), np.sin(half)])
    watch.start()
    means = WindowMeans(run)
    means.add(next(iter(imu.chunks(run.window))), turned)
    assess(run, place, rig, removed, None, summary, means, hold_height=False)
    watch.stop("assessment")

    result = prepared.navigate("conventional").finish()
    watch.start()
    document(result.kind, [log for log in (imu, table) if log], rig.effective(), {})
    write_result(str(output), result.document)
    watch.stop("writing")


def _check(run: NavigationRun, place: Place, rig: Rig) -> None:
    """Check a log as its preparation does, apart from reading."""
    imu, table, still = run.imu, run.table, run.still
    assert table is not None
    assert still is not None
    check_record_interval(imu, table, rig.table.axis)
    check_still(imu, still, rig.imu.figure("angle_random_walk"))
    check_alignment(imu, table, rig)
    start, end = (float(imu.time[k]) for k in (run.window.start, run.window.stop - 1))
    motion = motion_between(table, start, end)
    check_leaps(table, start, end, encoder_noise(table).resolution, LEAP)
    check_turning(imu, table, rig, motion)
    first = next(iter(imu.chunks(run.window)))
    f_b = sum_rotated(run.axis, run.angle_at(first.time), first.accel) / first.samples
    check_gravity(imu, f_b, place.base.specific_force)


def main(output: Path, folders: list[Path]) -> dict[str, float]:
    """Return the median CPU time of each part over the logs."""
    prepare_for_many_runs()
    watch = _Stopwatch()
    for folder in (*folders[:_WARM], *folders):
        navigate(folder, output, watch)
    found = {part: median(seconds[_WARM:]) for part, seconds in watch.seconds.items()}
    found["segments"] = found.pop("preparation") - found["checks"]
    found["solution"] = found.pop("navigation") - found["kernel"]
    return found


if __name__ == "__main__":
    names = [Path(name) for name in sys.argv[1:]]
    print(json.dumps(main(names[0], names[1:])))
