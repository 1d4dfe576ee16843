"""The zero-velocity filter on a turntable log: preparing the log, running, judging the estimates.

The filter itself is `rotcli.observe.zupt.model`. A log of any length goes through it part by
part, in the same numbers as at once.
"""

from rotcli.logs.record import ImuSource, TableLog
from rotcli.models.sensors import TriadErrors
from rotcli.observe.zupt.checks import one_rate
from rotcli.observe.zupt.consistency import Filtered, Summary
from rotcli.observe.zupt.options import WANDER_TIME, Options, noise_of
from rotcli.observe.zupt.run import Run, TiltFoundError, estimate_parts, prepare
from rotcli.rig.rig import Rig

__all__ = [
    "WANDER_TIME",
    "Filtered",
    "Options",
    "Run",
    "Summary",
    "TiltFoundError",
    "estimate_parts",
    "filter_log",
    "noise_of",
    "one_rate",
    "prepare",
]


def filter_log(
    imu: ImuSource,
    table: TableLog | None,
    rig: Rig,
    options: Options,
    gyro_errors: TriadErrors | None = None,
    accel_errors: TriadErrors | None = None,
) -> Filtered:
    """Prepare and filter a log; a table that stands off its attitude is filtered as it stands.

    Takes and raises what `prepare` does.
    """

    def passed(run: Run) -> Filtered:
        summary = Summary(run)
        for _ in summary.watch(estimate_parts(run)):
            pass
        return summary.result()

    try:
        return passed(prepare(imu, table, rig, options, gyro_errors, accel_errors))
    except TiltFoundError as found:
        return passed(found.run)
