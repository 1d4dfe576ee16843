"""Calibrate a gyro triad from still and turning segments, or from uneven motion (R16 section 3).

Turning at rate w about the unit axis u, a gyro triad reads `w_is + w N u + d`: generalised least
squares gives the bias d and `N u`, the scale factor and installation errors that this axis
excites. R16 is "MEMS IMU Error Mitigation Using Rotation Modulation Technique", Sensors 2016,
16, 2017.
"""

from collections.abc import Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from rotcli.calibrate.fit import TriadFit, fit_triad
from rotcli.calibrate.limits import LimitTest, limit_tests
from rotcli.calibrate.out_of_sample import OutOfSample, out_of_sample
from rotcli.calibrate.plausibility import (
    check_rates,
    check_result,
    check_segment_lengths,
)
from rotcli.calibrate.table_rate import table_rate
from rotcli.calibrate.uneven import uneven_means, with_encoder_noise
from rotcli.dataclass import dataclass
from rotcli.logs.record import ImuSource, Progress, Segment, TableLog
from rotcli.models.base import FixedBase
from rotcli.models.mean_covariance import SlowNoise
from rotcli.models.sensors import AXIS_COLUMN_NAMES, BIAS_NAMES, TriadErrors
from rotcli.run.checks import judge
from rotcli.run.consistency.blocks import (
    EarthHarmonics,
    SegmentBlocks,
    halves,
    reduce_segments,
)
from rotcli.run.consistency.goodness import FitTest, check_fit
from rotcli.run.consistency.log_fit import LogFit
from rotcli.run.consistency.means import SegmentMeans, TriadNoise
from rotcli.run.consistency.steadiness import check_clipping, check_steadiness, clipped
from rotcli.run.consistency.white_noise import check_white_noise, estimate_white_noise
from rotcli.run.evidence.gravity import check_gravity
from rotcli.run.findings import CheckError, Finding
from rotcli.run.motion import encoder_noise
from rotcli.run.recording import SAME_RATE
from rotcli.units import FloatArray, format_span

# s: a bias is calibrated for use; without a navigation window in the rig it is predicted for as
# long as R16 navigates, five minutes.
DEFAULT_HORIZON = 300.0
_NO_SLOW_NOISE = Finding(
    "no-slow-noise",
    "the rig has no bias_instability, rate_random_walk or Gauss-Markov figures. The sigmas contain "
    "white noise only and are too small; measure a still log of hours with rotcli allan",
)


@dataclass(frozen=True, eq=False)
class CalibrateSettings:
    """What a calibration assumes of the sensors, SI.

    white: (3,) rad/sqrt(s), angle random walks; None estimates them from the data. slow_noise: of
    each gyro; None where the rig has none. horizon: start and end (s) of the window for which the
    biases are predicted; None: 300 s after the last sample used. scale_sigma: (3,) fraction.
    gyro_range: rad/s. azimuth: rad, of the rig.
    """

    white: FloatArray | None = None
    slow_noise: Sequence[SlowNoise] | None = None
    horizon: tuple[float, float] | None = None
    scale_sigma: FloatArray | None = None
    gyro_range: float | None = None
    azimuth: float = 0.0


@dataclass(frozen=True, eq=False)
class Calibration:
    """Result of a calibration, SI.

    values: (6,) axis column of N (three fractions), then the biases (rad/s); covariance (6, 6) in
    the same order, named by `names`. The biases are predictions of their mean over `horizon` (s);
    own_sigma (3,): sigma of their means over the segments. segments: those used, still first.
    residual_rms: (3,) rad/s about the model. white: (3,) rad/sqrt(s), the random walk behind the
    covariance. predicted_bias (rad/s), predicted_column (fraction): R16 (35) and (36). rate:
    rad/s, that of the first turning segment. test: chi-squared of the three gyros. lag: s,
    estimated on uneven motion. out_of_sample: mean of the corrected gyros at that rate over the
    second halves of the segments, with a calibration of the first halves; None on uneven motion.
    limit_tests: the other tests, by name.
    """

    axis_name: str
    axis: FloatArray
    rate: float
    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    own_sigma: FloatArray
    horizon: tuple[float, float]
    segments: tuple[Segment, ...]
    residual_rms: FloatArray
    white: FloatArray
    predicted_bias: float
    predicted_column: float
    test: FitTest
    findings: tuple[Finding, ...]
    lag: float | None = None
    out_of_sample: OutOfSample | None = None
    limit_tests: Mapping[str, LimitTest | None] = field(default_factory=dict)

    @property
    def corrected_mean_rate(self) -> FloatArray:
        """Mean of the corrected gyros (3,), rad/s, out of sample; NaN on uneven motion."""
        after = self.out_of_sample
        return np.full(3, np.nan) if after is None else after.mean

    @property
    def errors(self) -> TriadErrors:
        """The constant errors found, for `rotcli.models.sensors.correct`."""
        return TriadErrors(np.outer(self.values[:3], self.axis), self.values[3:])


def calibrate(
    imu: ImuSource,
    table: TableLog,
    segments: Sequence[Segment],
    *,
    axis_name: str,
    axis: FloatArray,
    base: FixedBase | None,
    settings: CalibrateSettings | None = None,
    uneven: Segment | None = None,
    explained: bool = False,
    progress: Progress | None = None,
) -> Calibration:
    """Estimate biases and the axis column `N u` of the gyro triad by generalised least squares.

    segments: still and turning ones, of two rates at least; uneven: the interval of a motion at
    changing rates instead. axis: (3,) u in b (and s). base: None leaves Earth rate in the data, as
    the paper does. explained: whether findings about the logs name what contradicts the fit.
    progress: receives the share (0 to 1) that is done.

    Raises CheckError when the segments cannot separate the unknowns, or a check of severity error
    fails.
    """
    settings = settings or CalibrateSettings()
    u = np.asarray(axis, dtype=float)
    used = [uneven] if uneven is not None else list(segments)
    if uneven is None:
        check_rates(imu.path, used)
    reduced = reduce_segments(imu, table, used, u, settings.gyro_range, progress)
    steady = () if uneven is not None else check_steadiness(imu.path, reduced)
    rejected = check_clipping(imu.path, reduced)
    findings = list(judge("calibrate", [*steady, *rejected]))
    kept = [b for b, bad in zip(reduced, clipped(reduced), strict=True) if not bad]
    if rejected and not any(b.segment.rate for b in kept):
        raise CheckError(imu.path, "segment-clipped", rejected[0].text.partition(": ")[2])
    check_rates(imu.path, [b.segment for b in kept], uneven)
    work = _Work(imu, table, kept, u, base, settings, uneven=uneven is not None)
    result, more = _uneven(work) if uneven is not None else _even(work, bool(steady) or explained)
    names = (*AXIS_COLUMN_NAMES[axis_name], *BIAS_NAMES)
    result = replace(result, axis_name=axis_name, names=names)
    scale = (result.values, result.covariance, names, settings.scale_sigma)
    more += check_result(imu.path, *scale)
    tests = limit_tests(reduced if uneven is None else (), result.test.harmonics, *scale)
    after = result.out_of_sample if settings.slow_noise is not None else None
    tests["mean_after"] = None if after is None else after.test
    return replace(result, findings=(*findings, *judge("calibrate", more)), limit_tests=tests)


class _Work:
    """The reduced segments and what both kinds of fit derive from them."""

    def __init__(
        self,
        imu: ImuSource,
        table: TableLog,
        blocks: list[SegmentBlocks],
        u: FloatArray,
        base: FixedBase | None,
        settings: CalibrateSettings,
        *,
        uneven: bool = False,
    ) -> None:
        self.imu, self.uneven = imu, uneven
        self.path, self.table, self.blocks, self.u, self.base = imu.path, table, blocks, u, base
        self.settings = settings
        self.earth = EarthHarmonics.of(base, u)
        self.encoder = encoder_noise(table)
        self.estimated_white = estimate_white_noise(blocks, table if uneven else None, u)
        given = settings.white
        self.white = self.estimated_white if given is None else np.asarray(given, dtype=float)
        self.slow = list(settings.slow_noise or [SlowNoise()] * 3)
        self.noise = TriadNoise(self.white, self.slow)
        end = max(b.end for b in blocks)
        self.horizon = settings.horizon or (end, end + DEFAULT_HORIZON)

    def findings(self) -> list[Finding]:
        """Return the findings about attitude and noise figures."""
        found: list[Finding] = []
        if self.base is not None:
            force = np.mean([b.force for b in self.blocks], axis=0)
            found += check_gravity(self.imu, force, self.base.specific_force)
        if not self.uneven:
            found += check_white_noise(self.path, self.estimated_white, self.settings.white)
        if self.settings.slow_noise is None:
            found.append(_NO_SLOW_NOISE)
        return found


def _segment_means(work: _Work, blocks: Sequence[SegmentBlocks]) -> SegmentMeans:
    """Return the means of complete segments."""
    white = float(np.sqrt((work.u**2) @ (work.white**2)))
    rates = [table_rate(b, work.table, work.u, work.encoder, white) for b in blocks]
    rate = np.array([r.rate for r in rates])
    earth = [work.earth.at(b.mean(b.cos)[None], b.mean(b.sin)[None])[0] for b in blocks]
    gyro = np.array([b.mean(b.gyro) for b in blocks])
    z = gyro - np.array(earth) - np.outer(rate, work.u)
    start, end = np.array([[b.start, b.end] for b in blocks]).T
    return SegmentMeans(start, end, z, rate, np.diag([r.variance for r in rates]))


def _even(work: _Work, explained: bool) -> tuple[Calibration, list[Finding]]:
    """Fit segments at constant rate; explained: as in `LogFit`."""
    blocks = work.blocks
    means = _segment_means(work, blocks)
    fit = fit_triad(means, work.noise, work.u, work.horizon)
    known = work.settings.slow_noise is not None
    test, tested = LogFit(
        path=work.path,
        table=work.table,
        blocks=blocks,
        u=work.u,
        base=work.base,
        noise=work.noise,
        encoder=work.encoder,
        known=known,
        azimuth=work.settings.azimuth,
        explained=explained,
    ).test()
    segments = [b.segment for b in blocks]
    segments = [
        replace(s, rate=float(w), angle=float(w) * s.duration) if s.rate else s
        for s, w in zip(segments, means.rate, strict=True)
    ]
    turning = [s for s in segments if s.rate]
    findings = [*check_segment_lengths(work.path, turning, earth_known=work.base is not None)]
    findings += [*work.findings(), *tested]
    after = _out_of_sample(work)
    if known and not (tested or explained):  # one cause is enough
        findings += after.findings(work.path)
    still_time = sum(s.duration for s in segments if not s.rate)
    typical = float(np.sqrt(np.mean(work.white**2)))
    turned = sum(abs(s.angle) for s in turning)
    return _result(
        work,
        fit,
        test,
        rate=turning[0].rate,
        segments=tuple(segments),
        predicted_bias=typical / np.sqrt(still_time) if still_time else np.inf,
        predicted_column=typical * np.sqrt(sum(s.duration for s in turning)) / turned,
        residual_rms=_residual_rms(work, fit, means),
        out_of_sample=after,
    ), findings


def _result(work: _Work, fit: TriadFit, test: FitTest, **more: object) -> Calibration:
    """Return the result; sigmas are scaled where the data contradict the noise figures."""
    fields: dict[str, object] = {
        "axis_name": "u",
        "axis": work.u,
        "names": (),
        "values": fit.values,
        "covariance": test.enlarged(fit.covariance),
        "own_sigma": test.enlarged_own(fit.own_sigma),
        "horizon": work.horizon,
        "white": work.white,
        "test": test,
        "findings": (),
    }
    return Calibration(**{**fields, **more})  # type: ignore[arg-type]


def _residual_rms(work: _Work, fit: TriadFit, means: SegmentMeans) -> FloatArray:
    """Return the RMS (3,) of the residuals of all samples, rad/s."""
    squares, count = np.zeros(3), 0.0
    for k, b in enumerate(work.blocks):
        z = b.gyro - work.earth.at(b.cos, b.sin) - means.rate[k] * work.u
        rest = z - means.rate[k] * fit.values[:3] - fit.values[3:]
        squares += b.within + b.counts @ rest**2
        count += b.samples
    return np.asarray(np.sqrt(np.maximum(squares, 0.0) / count))


def _out_of_sample(work: _Work) -> OutOfSample:
    """Return the test of the second halves of the segments with a calibration of the first."""
    parts = [halves(b) for b in work.blocks]
    rate = next(b.segment.rate for b in work.blocks if b.segment.rate)
    at_rate = [abs(s.segment.rate - rate) <= SAME_RATE * abs(rate) for _, s in parts]
    used = [k for k, same in enumerate(at_rate) if same]
    second = [parts[k][1] for k in used]
    samples = np.array([s.samples for s in second])
    return out_of_sample(
        _segment_means(work, [first for first, _ in parts]),
        _segment_means(work, second),
        used,
        samples,
        np.average([s.mean(s.gyro) for s in second], axis=0, weights=samples),
        work.noise,
        work.u,
        work.horizon,
    )


def _uneven(work: _Work) -> tuple[Calibration, list[Finding]]:
    """Fit a motion at changing rates: integrated gyros against the encoder."""
    (b,) = work.blocks
    uneven = uneven_means(b, work.table, work.earth, work.u, work.encoder)
    means = replace(uneven.means, more=uneven.acceleration[:, None])
    main = int(np.argmax(np.abs(work.u)))
    means = with_encoder_noise(means, work.noise, main, work.u)
    fit = fit_triad(means, work.noise, work.u, work.horizon)
    flicker = np.array([slow.bias_instability for slow in work.slow])
    known = work.settings.slow_noise is not None
    test = check_fit(work.path, means, work.noise, work.u, flicker=flicker, judged=known)
    lag = -float(fit.fits[main].estimate[2]) / float(work.u[main])
    turning = np.abs(means.rate) > 0.1 * np.abs(means.rate).max()
    rate = float(np.median(np.abs(means.rate[turning])))
    typical = float(np.sqrt(np.mean(work.white**2)))
    length = means.end - means.start
    rest = np.array([f.residual for f in fit.fits])
    column = typical / np.sqrt(float(length @ (means.rate - means.rate.mean()) ** 2))
    segment = Segment(b.start, b.end, rate, float(length @ np.abs(means.rate)))
    text = (
        f"{work.path}: the table moves at changing rates; the integrated gyros were compared with "
        f"the encoder over {format_span(b.start, b.end)}, with a lag of {lag * 1e3:.1f} ms"
    )
    findings = [Finding("uneven-motion", text, "note", "", lag * 1e3, None, "ms")]
    return _result(
        work,
        fit,
        test,
        rate=rate,
        segments=(segment,),
        predicted_bias=typical / np.sqrt(float(length.sum())),
        predicted_column=float(column),
        residual_rms=np.sqrt(np.mean(rest**2, axis=1)),
        lag=lag,
    ), [*findings, *work.findings(), *test.findings]
