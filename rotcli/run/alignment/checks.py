"""Compare the clocks of the logs and the sense of the rotation, and say what to set."""

import numpy as np

from rotcli.logs.record import ImuSource, TableLog
from rotcli.rig.rig import Rig, TableSettings
from rotcli.run.alignment.correlation import correlate
from rotcli.run.alignment.lag import MIN_DRIFT, Lag, bias_step, find_in_series
from rotcli.run.alignment.series import Series, rate_series
from rotcli.run.evidence.direction import sense_advice
from rotcli.run.evidence.repeats import Repeats, find_repeats
from rotcli.run.findings import Finding
from rotcli.units import DEG, PPM, FloatArray, show_time

_MIN_EXPLAINED = 0.9  # of the variance of the gyro rate: with less it is another motion
_LARGE_LAG = 2.0  # samples: the ramps then reach into the segments
_SIGMAS = 4.0  # of the lag: 1e-4 by chance
_SMALL_LAG = 1.0 / 3.0  # of a sample: half a sample is the lag of means read as instants
_MAX_SCALE_SIGMAS = 10.0  # times scale_sigma of the rig, that a step of the bias resembles
_DEFAULT_SCALE_SIGMA = 3000.0 * PPM  # without that figure: data sheets state 0.1 to 0.5 %


def check_alignment(imu: ImuSource, table: TableLog, rig: Rig) -> tuple[Finding, ...]:
    """Compare the clocks of the logs, and the sense of the rotation, over the complete logs.

    Codes: `rotation-sense`, `clock-rate` (and `clock-lag` otherwise), `clock-lag-large` where a
    lag of more than two samples reaches a change of the rate; `ramp-step` where the bias steps
    with the rate, which looks like a lag; `copied-rows`, `repeated-rows`, which cause one.
    """
    repeats = find_repeats(imu)
    findings = repeats.findings(imu.path)
    series = rate_series(imu, table, rig.table.axis)
    if series is None:
        return findings
    shift, correlation = correlate(series)
    found = find_in_series(series, shift)
    if correlation < -_MIN_EXPLAINED and (found is None or found.explained < _MIN_EXPLAINED):
        advice = sense_advice(next(imu.chunks(slice(0, imu.samples))), rig)
        text = (
            f"{table.path}: the gyro rate is opposite to the table rate (correlation "
            f"{correlation:.3f}): {advice}"
        )
        return (*findings, Finding("rotation-sense", text, "warning", "", correlation))
    lag = _lag_findings(imu, table, found, rig.table, repeats)
    if lag and found is not None:
        step = _step_findings(imu, series, found, rig)
        lag = lag if step is None else step
    return (*findings, *lag)


def check_lag(
    imu: ImuSource, table: TableLog, axis: FloatArray, *, settings: TableSettings | None = None
) -> tuple[Finding, ...]:
    """Compare the times at which the gyros and the encoder show a change of the table rate.

    axis: (3,) in the body frame. settings: the rig's, which the table's times contain. A finding
    where the lag is above a third of a sample and four of its sigma: means read as instants lag by
    half a sample, other clocks by anything.
    """
    series = rate_series(imu, table, axis)
    found = None if series is None else find_in_series(series, correlate(series)[0])
    return _lag_findings(imu, table, found, settings or TableSettings(), Repeats())


def _lag_findings(
    imu: ImuSource,
    table: TableLog,
    found: Lag | None,
    settings: TableSettings,
    repeats: Repeats,
) -> tuple[Finding, ...]:
    if found is None or not 0.5 < found.scale < 2.0 or found.explained < _MIN_EXPLAINED:
        return ()
    large = abs(found.largest) > _LARGE_LAG * imu.interval
    # Clocks that differ as good crystals do are left alone until that lag is large.
    size = abs(found.smallest if found.crystals and not large else found.largest)
    limit = max(_SMALL_LAG * imu.interval, _SIGMAS * found.sigma)
    if size < max(limit, repeats.delay):  # rows that repeat the row before are late by themselves
        return ()
    if found.drifts and not repeats.copies:
        code = "clock-lag-large" if large else "clock-rate"
        text = f"{imu.path}: {_drift_in_words(found, table, settings)}"
        return (Finding(code, text, "warning", "", found.drift / PPM, MIN_DRIFT / PPM, "ppm"),)
    text = f"{imu.path}: {_lag_in_words(found, imu, settings.time_offset, repeats)}"
    code = "clock-lag-large" if large else "clock-lag"
    return (Finding(code, text, "warning", "", found.lag * 1e3, limit * 1e3, "ms"),)


def _step_findings(
    imu: ImuSource, series: Series, found: Lag, rig: Rig
) -> tuple[Finding, ...] | None:
    """Return the findings where a step of the bias explains the rates better than a lag.

    None: the lag explains them better. A step that is smaller than plausible scale factor errors
    is none that the log can show.
    """
    step = bias_step(series)
    if step is None or step.residual_variance >= found.residual_variance or not step.rate_change:
        return None
    known = rig.imu.figure("scale_sigma")
    sigma = _DEFAULT_SCALE_SIGMA if known is None else float(np.sqrt(np.mean(known**2)))
    resembles, limit = abs(step.size / step.rate_change), _MAX_SCALE_SIGMAS * sigma
    if resembles <= limit:
        return ()
    text = (
        f"{imu.path}: the gyro bias along the table axis changes by {abs(step.size) / DEG:.3g} "
        f"deg/s near {show_time(step.time)} s, where the table rate changes by "
        f"{abs(step.rate_change) / DEG:.3g} deg/s; a scale factor error of {resembles / PPM:.0f} "
        f"ppm would look alike ({resembles / sigma:.2g} times scale_sigma). Check the log for a "
        "bias that was switched or removed there"
    )
    return (Finding("ramp-step", text, "warning", "", resembles / PPM, limit / PPM, "ppm"),)


def _drift_in_words(found: Lag, table: TableLog, settings: TableSettings) -> str:
    """Return the text of clocks that differ in rate, with the offset and the rate to set."""
    offset = settings.time_offset + found.lag + found.drift * (float(table.time[0]) - found.centre)
    rate = settings.clock_rate + found.drift * (1.0 + settings.clock_rate)
    lags = [
        f"{1e3 * (found.lag + found.drift * (t - found.centre)):.1f} ms at {t:.0f} s"
        for t in (found.first, found.last)
    ]
    return (
        f"the clocks differ by {found.drift / PPM:.0f} ppm (sigma "
        f"{found.drift_sigma / PPM:.0f} ppm): the gyro log lags the table log by "
        f"{' and by '.join(lags)}. Record both logs on one clock, or set [table] clock_rate = "
        f"{rate / PPM:.1f} and time_offset = {offset:.4f}"
    )


def _lag_in_words(found: Lag, imu: ImuSource, time_offset: float, repeats: Repeats) -> str:
    how = "lags" if found.lag > 0.0 else "leads"
    digits = int(np.clip(np.ceil(-np.log10(max(found.sigma, 1e-9))), 3, 5))
    offset = float(round(time_offset + found.lag, digits)) + 0.0  # no -0.0
    clock = f"set [table] time_offset = {offset!r}"
    text = (
        f"the gyro log {how} the table log by {abs(found.lag) * 1e3:.2f} ms (sigma "
        f"{found.sigma * 1e3:.2f} ms, one sample is {imu.interval * 1e3:g} ms); "
    )
    if repeats.copies:
        return text + f"{repeats.summary()} and delay those that follow; record again"
    # The other meaning of a sample moves it by half of one.
    half = found.lag / imu.interval * (1.0 if imu.sampling == "instant" else -1.0)
    if not 0.3 < half < 0.7:
        return text + clock
    other = "average" if imu.sampling == "instant" else "instant"
    kind = "means" if imu.sampling == "instant" else "instants"
    return text + (
        f"the lag is half a sample, so the samples are probably {kind}; set [imu] sampling = "
        f'"{other}", else {clock}'
    )
