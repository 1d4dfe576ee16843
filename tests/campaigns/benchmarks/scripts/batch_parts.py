"""CPU time of the parts of a navigation, each called alone; printed as JSON, s.

Reading: the rig, and both logs opened and read as `navigate` does, with the checks of columns,
units, sizes, clock and gaps. Kernel: the strapdown integration of the window. Writing: the
document with the hashes of the logs, checked, and written with fsync. A batch is asked to take
little more than these three. The others: the search for segments and the checks of the log against
its table and itself; the errors of the solution against the base; the errors to expect and the
tests of the residuals.
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
from rotcli.models.sensors import correct
from rotcli.models.strapdown import InitialState, mechanize_log
from rotcli.navigate.api import NavigateOptions, prepare_navigation
from rotcli.navigate.assess import assess
from rotcli.navigate.estimate import Summary, navigate_chunks
from rotcli.navigate.residuals import WindowMeans

ASKED = ("reading", "kernel", "writing")
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
    watch.stop("segments and checks")

    (run, place), removed = prepared.runs["conventional"], prepared.errors["conventional"]
    assert isinstance(imu, ImuLog)
    start = InitialState(place.latitude, 0.0, place.height, np.zeros(3), place.base.C_nb)
    watch.start()
    gyro = correct(removed.gyro, imu.gyro[run.window])
    mechanize_log(gyro, imu.accel[run.window], imu.interval, start)
    watch.stop("kernel")

    watch.start()
    summary, means = Summary("conventional", run.rate), WindowMeans(run)
    for part in navigate_chunks(
        run, place, removed.gyro, removed.accel, mode="conventional", watch=means.add
    ):
        summary.add(part)
    watch.stop("solution")

    watch.start()
    assess(run, place, rig, removed, None, summary, means, hold_height=False)
    watch.stop("errors to expect")

    result = prepared.navigate("conventional").finish()
    watch.start()
    document(result.kind, [log for log in (imu, table) if log], rig.effective(), {})
    write_result(str(output), result.document)
    watch.stop("writing")


def main(output: Path, folders: list[Path]) -> dict[str, float]:
    """Return the median CPU time of each part over the logs."""
    prepare_for_many_runs()
    watch = _Stopwatch()
    for folder in (*folders[:_WARM], *folders):
        navigate(folder, output, watch)
    found = {part: median(seconds[_WARM:]) for part, seconds in watch.seconds.items()}
    found["errors of the solution"] = found.pop("solution") - found["kernel"]
    return found


if __name__ == "__main__":
    names = [Path(name) for name in sys.argv[1:]]
    print(json.dumps(main(names[0], names[1:])))
