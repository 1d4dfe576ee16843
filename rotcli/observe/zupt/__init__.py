"""The zero-velocity filter on a turntable log: preparing the log, running, judging the estimates.

The filter itself is `rotcli.observe.zupt.model`. A log of any length goes through it part by
part, in the same numbers as at once.
"""

from rotcli.logs.record import ImuSource, TableLog
from rotcli.models.sensors import TriadErrors
from rotcli.observe.zupt.checks.window import has_single_rate
from rotcli.observe.zupt.consistency import ZuptHistory, ZuptResult
from rotcli.observe.zupt.options import DEFAULT_CORRELATION_TIME, Options, noise_from_rig
from rotcli.observe.zupt.passes import AttitudeOffsetError, estimate_parts
from rotcli.observe.zupt.prepare import prepare_zupt
from rotcli.observe.zupt.run import ZuptRun
from rotcli.rig.rig import Rig

__all__ = [
    "DEFAULT_CORRELATION_TIME",
    "AttitudeOffsetError",
    "Options",
    "ZuptHistory",
    "ZuptResult",
    "ZuptRun",
    "estimate_parts",
    "filter_log",
    "has_single_rate",
    "noise_from_rig",
    "prepare_zupt",
]


def filter_log(
    imu: ImuSource,
    table: TableLog | None,
    rig: Rig,
    options: Options,
    gyro_errors: TriadErrors | None = None,
    accel_errors: TriadErrors | None = None,
) -> ZuptResult:
    """Prepare and filter a log; a table off its attitude is filtered about the estimated one.

    Takes and raises what `prepare_zupt` does.
    """

    def passed(run: ZuptRun) -> ZuptResult:
        summary = ZuptHistory(run)
        for _ in summary.watch(estimate_parts(run)):
            pass
        return summary.result()

    try:
        return passed(prepare_zupt(imu, table, rig, options, gyro_errors, accel_errors))
    except AttitudeOffsetError as found:
        return passed(found.run)
