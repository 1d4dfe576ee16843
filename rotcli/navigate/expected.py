"""Expected errors of a navigation run: from rig, calibration, motion and the log's residuals.

What `rotcli.models.expected.errors` computes, for one run of the tool: the noise figures are the
rig's, the contrast is that of the calibration's segments in the same log, accelerometer biases are
measured in the still segment (else a prior), the attitude's sigmas are the rig's.

Three tests follow from the same covariance: the RMS of eleven errors with one p value for the
run, the mean corrected gyro output over the window, and whitened means of a second.
"""

from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.expected.errors import ExpectedErrors, expected_errors
from rotcli.models.expected.motion import StillTable, TooManyBlocksError, cut_window
from rotcli.models.expected.sources import (
    AccelSource,
    AxisSource,
    Contrast,
    GyroSource,
    generalised_contrast,
    least_squares_contrast,
    still_contrast,
)
from rotcli.models.expected.statistics import ExpectedStatistics, expected_statistics
from rotcli.models.mean_covariance import IntervalNoise, SlowNoise
from rotcli.navigate.companions import Companions, accel_companions, gyro_companions
from rotcli.navigate.place import Place
from rotcli.navigate.residuals import StillAccelerometers, WindowResiduals
from rotcli.rig.noise_sources import accel_noise, gyro_noise, missing_figures
from rotcli.rig.rig import Rig
from rotcli.run.correction import Correction
from rotcli.run.recording import NavigationRun
from rotcli.units import DEG, FloatArray

_SEPARATION = 60.0  # s, between a calibration of another log and the window; turn-on dominates
MEASURED, CALIBRATED, PRIOR = "measured", "calibrated", "prior"


@dataclass(frozen=True, eq=False)
class Basis:
    """What an expectation was made of.

    accel_bias: measured, calibrated, prior, or None where nothing is known of it; segments: those
    of the correction, s; attitude_sigma: (3,) rad; incomplete: what makes it a lower bound.
    """

    segments: tuple[tuple[float, float], ...] = ()
    accel_bias: str | None = None
    attitude_sigma: FloatArray = field(default_factory=lambda: np.zeros(3))
    incomplete: str = ""


@dataclass(frozen=True, eq=False)
class Expectation:
    """Expected errors of a run and the tests of its residuals, or why there are none."""

    reason: str = ""
    errors: ExpectedErrors | None = None
    statistics: ExpectedStatistics | None = None
    basis: Basis = field(default_factory=Basis)
    tests: Companions = field(default_factory=Companions)


@dataclass(frozen=True, eq=False)
class NavigationSetup:
    """One navigation run: logs and window, place, rig, mode and what the mode corrects.

    correction: the calibration, None in conventional mode; still: the segment (s) that
    conventional takes its biases from.
    """

    run: NavigationRun
    place: Place
    rig: Rig
    mode: str
    correction: Correction | None
    still: tuple[float, float] | None
    hold_height: bool


def expectation(
    setup: NavigationSetup, residuals: WindowResiduals, rest: StillAccelerometers | None
) -> Expectation:
    """Return the expected errors of a run and the tests of its residuals.

    rest: accelerometer biases that the still segment shows.
    """
    missing = missing_figures(setup.rig.imu)
    if missing:
        return Expectation(f"[imu] lacks {', '.join(missing)}")
    gyro, reason, incomplete = _gyro_source(setup)
    if gyro is None:
        return Expectation(reason)
    accel, accel_bias, unknown = _accel_source(setup, rest)
    sigma, unlevelled = _attitude_sigma(setup)
    basis = Basis(
        segments=_segments(setup),
        accel_bias=accel_bias,
        attitude_sigma=sigma,
        incomplete=incomplete or unknown or unlevelled,
    )
    run = setup.run
    start, end = residuals.start, _end(run)
    max_rate = float(np.max(np.abs(residuals.rate)))
    try:
        blocks = cut_window(start, end, _angle(run), max_rate)
    except TooManyBlocksError as error:
        return Expectation(f"the window is too long: {error}", basis=basis)
    errors = expected_errors(_still_table(setup), blocks, gyro, accel, sigma)
    tests = Companions()
    changed = not _same_log(setup) or _unknown_column(setup)
    mean, gyro_blocks = gyro_companions(
        run, residuals, gyro, end, changed=changed, known=not incomplete
    )
    tests = replace(tests, gyro_mean=mean, gyro_blocks=gyro_blocks)
    if rest is not None:
        base = setup.place.base
        accel_mean, accel_blocks, found = accel_companions(run, residuals, accel, base, rest)
        tests = replace(tests, accel_mean=accel_mean, accel_blocks=accel_blocks, level=found)
    return Expectation(
        errors=errors,
        statistics=expected_statistics(errors, incomplete=basis.incomplete),
        basis=basis,
        tests=tests,
    )


def _start(run: NavigationRun) -> float:
    first = run.window.start
    return float(run.imu.times(slice(first, first + 1))[0])


def _end(run: NavigationRun) -> float:
    last = run.window.stop - 1
    return float(run.imu.times(slice(last, last + 1))[0])


def _angle(run: NavigationRun):  # type: ignore[no-untyped-def]
    """Return the table angle as a function of time, kept inside the table log."""
    if run.table is None:
        return run.angle_at
    first, last = float(run.table.time[0]), float(run.table.time[-1])
    return lambda time: run.angle_at(np.clip(time, first, last))


def _still_table(setup: NavigationSetup) -> StillTable:
    place = setup.place
    return StillTable(
        latitude=place.latitude,
        height=place.height,
        gravity=place.gravity,
        pitch=place.pitch,
        roll=place.roll,
        azimuth=place.azimuth,
        axis=setup.run.axis,
        hold_height=setup.hold_height,
    )


def _same_log(setup: NavigationSetup) -> bool:
    """Return whether the calibration was made of this log: records, first and last time agree."""
    imu, correction = setup.run.imu, setup.correction
    if correction is None:
        return True
    return correction.log == (float(imu.rows), float(imu.time[0]), float(imu.time[-1]))


def _segments(setup: NavigationSetup) -> tuple[tuple[float, float], ...]:
    if setup.correction is None:
        return () if setup.still is None else (setup.still,)
    return setup.correction.segments_used


def _gyro_source(setup: NavigationSetup) -> tuple[GyroSource | None, str, str]:
    """Return the gyros' source; else why there is none; and what makes it incomplete."""
    imu, correction = setup.rig.imu, setup.correction
    noise = gyro_noise(imu)
    prior = imu.figure("scale_sigma")
    unknown, incomplete = np.zeros(3), ""
    if _unknown_column(setup):
        unknown = np.zeros(3) if prior is None else prior
        if prior is None:
            incomplete = "the axis column is unknown ([imu] scale_sigma)"
    if correction is None:
        if setup.still is None:
            return None, "no still segment", ""
        contrast = still_contrast(*setup.still)
        axes = tuple(AxisSource(white, slow, contrast) for white, slow in noise)
        return GyroSource(axes, column_sigma=unknown), "", incomplete
    rates = correction.segment_rates
    if not correction.segments_used or len(rates) != len(correction.segments_used):
        return None, f"{correction.path} names no segments", ""
    turn_on = np.zeros(3)
    if not _same_log(setup):
        found = imu.figure("turn_on_sigma")
        turn_on = np.zeros(3) if found is None else found
        if found is None:
            incomplete = "the calibration is of another log and [imu] turn_on_sigma is missing"
    column = correction.gyro_column
    left_in = np.zeros(3) if column is None or setup.mode == "full" else column
    spans, horizon = np.array(correction.segments_used).T, correction.horizon
    if not _same_log(setup):
        # The clocks are not comparable: the calibration counts as made just before the window.
        shift = _start(setup.run) - _SEPARATION - float(spans.max())
        spans = spans + shift
        horizon = None if horizon is None else (horizon[0] + shift, horizon[1] + shift)
    correction = replace(correction, horizon=horizon)
    axes = tuple(
        AxisSource(white, slow, _contrast(correction, spans, np.array(rates), (white, slow)))
        for white, slow in noise
    )
    return GyroSource(axes, left_in, unknown, turn_on), "", incomplete


def _unknown_column(setup: NavigationSetup) -> bool:
    """Return whether the table turns and nothing is known of the axis column."""
    run, correction = setup.run, setup.correction
    turning = bool(run.rate) or not run.constant_rate
    return turning and (correction is None or correction.gyro_column is None)


def _contrast(
    correction: Correction, spans: FloatArray, rate: FloatArray, noise: tuple[float, SlowNoise]
) -> Contrast:
    """Return how a calibration estimated bias and axis column from its segments.

    With a horizon by generalised least squares, the bias predicted for it; else by least squares
    weighted by the durations.
    """
    start, end = spans
    if correction.gyro_column is None or len(start) == 1:
        weights = (end - start) / (end - start).sum()
        return Contrast(start, end, weights, np.zeros(len(start)))
    if correction.horizon is None:
        return least_squares_contrast(start, end, rate)
    white, slow = noise
    return generalised_contrast(IntervalNoise(start, end, slow, white), rate, correction.horizon)


def _accel_source(
    setup: NavigationSetup, rest: StillAccelerometers | None
) -> tuple[AccelSource, str | None, str]:
    """Return the accelerometers' source, where its bias comes from, what makes it incomplete."""
    noise = accel_noise(setup.rig.imu)
    if rest is not None:
        contrast = still_contrast(rest.start, rest.end)
        axes = tuple(AxisSource(white, slow, contrast) for white, slow in noise)
        return AccelSource(axes, rest.bias), MEASURED, ""
    axes = tuple(AxisSource(white, slow, None) for white, slow in noise)
    sigma = setup.rig.imu.figure("accel_bias_sigma")
    if sigma is not None:
        return AccelSource(axes, bias_sigma=sigma), PRIOR, ""
    return AccelSource(axes), None, "no still segment shows the accelerometer biases"


def _attitude_sigma(setup: NavigationSetup) -> tuple[FloatArray, str]:
    """Return the sigmas (3,) rad of the rig's attitude that count, and what is unknown of it.

    In conventional mode the still segment has the attitude of the window: wrong Earth rate and
    wrong gravity are in the biases and cancel.
    """
    attitude, run = setup.rig.attitude, setup.run
    if setup.mode == "conventional" and run.constant_rate and run.rate == 0.0:
        return np.zeros(3), ""
    known = (attitude.pitch_sigma, attitude.roll_sigma, attitude.azimuth_sigma)
    sigma = np.array([value or 0.0 for value in known])
    if attitude.azimuth is None and attitude.azimuth_sigma is None:
        return sigma, "the azimuth is assumed ([attitude] azimuth)"
    if attitude.pitch is None or attitude.roll is None:
        bias = setup.rig.imu.figure("accel_bias_sigma")
        if bias is None:
            return sigma, "the level is that of uncalibrated accelerometers"
        level = float(np.max(bias)) / setup.place.gravity
        sigma[:2] = np.maximum(sigma[:2], level)
    return sigma, ""


def describe_noise(rig: Rig) -> dict[str, object]:
    """Return the noise figures of a rig that an expectation used, by key, in the rig's units."""
    figures = rig.effective().get("imu", {})
    names: Sequence[str] = (
        "angle_random_walk",
        "bias_instability",
        "rate_random_walk",
        "velocity_random_walk",
        "accel_bias_instability",
        "turn_on_sigma",
        "accel_bias_sigma",
    )
    return {name: figures[name] for name in names if name in figures}


def in_degrees(attitude: FloatArray) -> dict[str, float]:
    """Return sigmas (3,) rad of pitch, roll, azimuth by name, deg."""
    return {
        name: float(value) / DEG
        for name, value in zip(("pitch", "roll", "azimuth"), attitude, strict=True)
    }
