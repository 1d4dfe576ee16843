"""The passes of the ZUPT filter over a log: readings, filter, smoother, chunk by chunk."""

from collections.abc import Iterator

from rotcli.errors import RotcliError
from rotcli.logs.record import Progress
from rotcli.models.sensors import correct
from rotcli.observe.zupt.checks.explanation import MAX_SAMPLES, Evidence, Explanation
from rotcli.observe.zupt.filter import (
    Estimates,
    FilteredUpdates,
    ZuptFilter,
    significant_tilt,
    smooth_updates,
)
from rotcli.observe.zupt.run import ZuptRun, table_angles

UPDATES = 4096  # filtered together: the covariance then runs in 128 blocks side by side


class AttitudeOffsetError(RotcliError):
    """A first pass found the table off its nominal attitude; `run` is to be filtered instead."""

    def __init__(self, run: ZuptRun) -> None:
        super().__init__("the table is off its nominal attitude")
        self.run = run


def estimate_parts(run: ZuptRun, progress: Progress | None = None) -> Iterator[Estimates]:
    """Filter a run, yielding its estimates chunk by chunk.

    progress: called with the share (0 to 1) that is done. Raises AttitudeOffsetError, at the end of
    the filter's pass, where the table is significantly off the nominal attitude and no other error
    of the set-up explains the readings.
    """
    smooth = run.settings.smooth
    chunks: list[FilteredUpdates] = []
    for chunk in _filtered(run, progress, 0.5 if smooth else 1.0):
        if smooth:
            chunks.append(chunk)
        else:
            yield chunk.estimates
        last = chunk.estimates
    tilt = significant_tilt(last) if run.tilt_offset is None else None
    if tilt is not None:
        explanation = explain(run)
        if explanation.cause in ("attitude", "unknown"):
            raise AttitudeOffsetError(run.about_estimated_attitude(tilt, explanation))
    if smooth:
        yield from _smoothed(run, chunks, progress)


def explain(run: ZuptRun) -> Explanation:
    """Return the error of the set-up that explains the accelerometers' readings."""
    evidence = Evidence(run.settings, run.imu.interval)
    step = max(1, (run.span.stop - run.span.start) // MAX_SAMPLES)
    for chunk in run.imu.chunks(run.span):
        accel = chunk.accel if run.accel_errors is None else correct(run.accel_errors, chunk.accel)
        evidence.add(accel, table_angles(run.table, chunk.time), step)
    return evidence.explain()


def _filtered(run: ZuptRun, progress: Progress | None, share: float) -> Iterator[FilteredUpdates]:
    """Yield the chunks of the filter's pass, which is `share` of the work."""
    zupt_filter, s, done = ZuptFilter(run.settings, run.count), run.settings, 0
    for gyro, accel in run.readings(UPDATES):
        model = run.update_model(done, (len(gyro) - 1) // s.samples)
        chunk = zupt_filter.advance(model, gyro, accel)
        done = zupt_filter.done
        yield chunk
        if progress:
            progress(share * done / run.count)


def _smoothed(
    run: ZuptRun, chunks: list[FilteredUpdates], progress: Progress | None
) -> Iterator[Estimates]:
    """Go back through the chunks of the filter, then yield them from the first on.

    The gains are computed again, chunk by chunk: to store those of days takes ten times as much.
    """
    next_state, done = None, run.count
    smoothed: list[Estimates] = []
    while chunks:
        chunk = chunks.pop()
        n = len(chunk.estimates.time)
        done -= n
        estimates, next_state = smooth_updates(run.update_model(done, n), chunk, next_state)
        smoothed.append(estimates)
        if progress:
            progress(1.0 - 0.5 * done / run.count)
    while smoothed:
        yield smoothed.pop()
