"""The history of a filtered log, and the tests of its consistency."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models import kalman
from rotcli.models.running import RunningStatistics
from rotcli.observe.zupt.checks.disturbances import InnovationWindows, RelativeRotation
from rotcli.observe.zupt.checks.explanation import Explanation, describe
from rotcli.observe.zupt.filter import Estimates, significant_tilt
from rotcli.observe.zupt.model import ACCEL_BIAS, GYRO_BIAS, TILT, Settings
from rotcli.observe.zupt.options import DEFAULT_SCALE_SIGMA
from rotcli.observe.zupt.passes import explain
from rotcli.observe.zupt.run import ZuptRun
from rotcli.run.findings import Finding, texts
from rotcli.units import DEG, PPM, FloatArray, show_time

HISTORY_POINTS = 301  # updates whose estimates are kept, for plots
# A bias beyond so many initial sigmas is kept too small by the prior: 6e-7 of false alarms.
MAX_INITIAL_SIGMAS = 5.0
# Times the upper bound of mean NIS: beyond it sigmas are 1.4 times too small, and more.
NIS_REJECT_FACTOR = 2.0
# Noise figures are known to 5 %: the bounds of mean NIS are widened by a tenth.
NIS_TOLERANCE = 0.1
# Scale factor errors beyond so many sigmas of the rig have another cause (the limit of calibrate).
MAX_SCALE_SIGMAS = 10.0
MEASUREMENTS = 3  # per update; the expectation of NIS
_UNUSABLE = "; do not use any estimate"
_CONTRADICTIONS = {
    "lever arm": "the accelerometers contradict the lever arm",
    "accelerometers": "scale factor errors of the accelerometers explain the tilt",
}


@dataclass(frozen=True, eq=False)
class ZuptResult:
    """The results of the filter on a log.

    settings: of the filter. estimates: HISTORY_POINTS of its updates, evenly spaced, with the first
    and the last, times on the log's clock; biases are those of the sensors, calibration included.
    rms: (m,) root mean square of every update's values; rms_attitude: (3,) rad, of the errors of
    pitch, roll, azimuth. update_interval: s. rate: rad/s, the dominant one of the table, 0 when
    still; angle: rad, at the start. nis: mean and its 95 % bounds. start, end: s. calibrated:
    whether gyro scale factor and installation errors were compensated first. findings: about the
    logs and of the filter.
    """

    settings: Settings
    estimates: Estimates
    rms: FloatArray
    rms_attitude: FloatArray
    update_interval: float
    rate: float
    angle: float
    start: float
    end: float
    nis: float
    nis_bounds: tuple[float, float]
    calibrated: bool
    measured_noise: bool
    prior_violations: tuple[str, ...]
    explanation: Explanation | None
    findings: tuple[Finding, ...]
    warnings: tuple[str, ...]

    @property
    def nis_verdict(self) -> str:
        """Verdict on the sigmas: consistent, conservative, optimistic or inconsistent.

        Inconsistent: mean NIS is so far above its expectation that no estimate may be used.
        """
        return nis_verdict(self.nis, self.nis_bounds)

    @property
    def contradiction(self) -> str | None:
        """The error of the set-up that the filter has put into its estimates."""
        return None if self.explanation is None else _CONTRADICTIONS.get(self.explanation.cause)


def nis_verdict(nis: float, bounds: tuple[float, float]) -> str:
    """Return the verdict on sigmas from the mean NIS and its 95 % bounds.

    >>> [nis_verdict(nis, (2.9, 3.1)) for nis in (0.5, 2.7, 3.3, 4.0, 7.0)]
    ['conservative', 'consistent', 'consistent', 'optimistic', 'inconsistent']
    """
    low, high = bounds[0] * (1.0 - NIS_TOLERANCE), bounds[1] * (1.0 + NIS_TOLERANCE)
    if nis > NIS_REJECT_FACTOR * high:
        return "inconsistent"
    return "conservative" if nis < low else "optimistic" if nis > high else "consistent"


class ZuptHistory:
    """The history of a run whose estimates come chunk by chunk."""

    def __init__(self, run: ZuptRun) -> None:
        self.run = run
        self._keep = np.unique(np.linspace(0, run.count - 1, HISTORY_POINTS).round().astype(int))
        self._done = 0
        self._errors = RunningStatistics()
        self._nis = 0.0
        tau = run.settings.samples * run.imu.interval
        self._windows, self._rotation = InnovationWindows(tau), RelativeRotation(tau)
        self._kept: list[Estimates] = []
        self._last: Estimates | None = None

    def watch(self, parts: Iterable[Estimates]) -> Iterator[Estimates]:
        """Take the chunks of `estimate_parts` and pass them on, calibration included."""
        for part in parts:
            self._last = part
            total = self.run.total_estimates(part)
            self._errors.add(np.column_stack([total.values, total.attitude_errors]))
            self._nis += float(part.nis.sum())
            self._windows.add(part.nis)
            self._rotation.add(part.table_angle, part.relative_angle)
            n = len(part.time)
            first, stop = np.searchsorted(self._keep, [self._done, self._done + n])
            at = self._keep[first:stop] - self._done
            names = ("time", "values", "sigma", "nis")
            kept = {name: getattr(total, name)[at] for name in names}
            self._kept.append(replace(total, **kept))
            self._done += n
            yield total

    def result(self) -> ZuptResult:
        """Return the results, once all chunks have passed."""
        if self._last is None:
            raise ValueError("no chunk has passed")
        run, rms, count = self.run, self._errors.rms, self._done
        names = ("time", "values", "sigma", "nis")
        time, values, sigma, each_nis = (
            np.concatenate([getattr(part, n) for part in self._kept]) for n in names
        )
        estimates = replace(self._kept[-1], time=time, values=values, sigma=sigma, nis=each_nis)
        nis, bounds = self._nis / count, kalman.mean_bounds(MEASUREMENTS, count)
        violations = prior_violations(self._last.values[-1], run.settings)
        tilt = significant_tilt(self._last) if run.tilt_offset is None else None
        explanation = run.explanation
        suspicious = (
            tilt is not None
            or nis_verdict(nis, bounds) in ("optimistic", "inconsistent")
            or bool(violations)
            or self._windows.largest() is not None
        )
        if explanation is None and suspicious:
            explanation = explain(run)
        findings = _set_up_findings(run, explanation, self._last)
        if explanation is None or explanation.cause not in _CONTRADICTIONS:  # one cause is enough
            disturbances = self._disturbances(nis_verdict(nis, bounds))
            if disturbances and explanation is not None and explanation.cause == "unknown":
                findings = []
            findings += disturbances or violations or _innovation_findings(nis, bounds)
        findings += self._scale_findings()
        return ZuptResult(
            settings=run.settings,
            estimates=estimates,
            rms=rms[:-3],
            rms_attitude=rms[-3:],
            update_interval=run.settings.samples * run.imu.interval,
            rate=run.rate,
            angle=run.angle,
            start=run.start,
            end=run.end,
            nis=nis,
            nis_bounds=bounds,
            calibrated=run.calibrated,
            measured_noise=run.measured_noise,
            prior_violations=tuple(texts(violations)),
            explanation=explanation,
            findings=(*run.findings, *findings),
            warnings=(*run.warnings, *texts(findings)),
        )

    def _scale_findings(self) -> list[Finding]:
        """Return the finding about a gyro rate that is not that of the table."""
        run = self.run
        causes = ("ramp-step", "fit-contradicted", "table-angle", "clock-lag-large")
        if self._rotation.largest() is not None or any(f.code in causes for f in run.findings):
            return []  # the same, seen at the changes of the rate
        allowed = run.settings.initial.scale or DEFAULT_SCALE_SIGMA
        limit, error = MAX_SCALE_SIGMAS * allowed, self._rotation.scale_error()
        if error is None or abs(error) <= limit:
            return []
        text = (
            f"the gyro rate about the axis differs from the table rate by {100.0 * error:.2g} %, "
            f"{abs(error) / allowed:.2g} times the sigma of the scale factor "
            f"({allowed / PPM:g} ppm); check the unit of the gyros, and whether the table log is "
            "that of this run"
        )
        return [Finding("gyro-scale", text, value=error, limit=limit)]

    def _disturbances(self, verdict: str) -> list[Finding]:
        """Return the findings about windows and updates that deviate from the others."""
        unusable = _UNUSABLE if verdict == "inconsistent" else ""
        findings = []
        run = self.run
        jump, window = self._rotation.largest(), self._windows.largest()
        if jump is not None and not any(f.code == "table-angle" for f in run.findings):
            time = show_time(run.start + jump.time)
            text = (
                f"gyros and table angle differ by a jump of {jump.size / DEG:.3g} deg near {time} "
                "s; check for spikes, clipped or lost samples, and for wrong table records"
                f"{unusable}"
            )
            finding = Finding("jump", text, where=f"{time} s", value=jump.size, limit=jump.limit)
            findings.append(replace(finding, unit="rad"))
        # Without a calibration and without its states every change of rate is a disturbance.
        uncalibrated = run.rate and not (run.calibrated or run.settings.initial.scale)
        if window is not None and not uncalibrated:
            time = show_time(run.start + window.time)
            text = (
                f"innovations near {time} s are {window.ratio:.2g} times the usual mean square; "
                "check for spikes, repeated or lost samples, a step of a bias, or a touched "
                f"table{unusable}"
            )
            findings.append(
                Finding(
                    "disturbance",
                    text,
                    where=f"{time} s",
                    value=window.ratio,
                    limit=window.limit,
                )
            )
        return findings


def _innovation_findings(nis: float, bounds: tuple[float, float]) -> list[Finding]:
    """Return the finding about all innovations."""
    verdict = nis_verdict(nis, bounds)
    if verdict not in ("optimistic", "inconsistent"):
        return []
    text = (
        f"innovations exceed their sigma (mean NIS {nis:.3g}, limit {bounds[1]:.3g}); check for a "
        "moving table, uncalibrated sensors, a wrong lever arm or time offset, or too small noise "
        f"figures{_UNUSABLE if verdict == 'inconsistent' else ''}"
    )
    return [Finding("innovations", text, value=nis, limit=bounds[1])]


def _set_up_findings(
    run: ZuptRun, explanation: Explanation | None, last: Estimates
) -> list[Finding]:
    """Return the finding about the set-up that explains a tilt or inconsistent innovations."""
    if explanation is None:
        return []
    tilt = run.tilt_offset if run.tilt_offset is not None else last.values[-1, TILT]
    if explanation.cause not in _CONTRADICTIONS and run.tilt_offset is None:
        return []
    size = float(np.hypot(*tilt))
    code = {
        "attitude": "attitude-offset",
        "lever arm": "lever-arm",
        "accelerometers": "accelerometer-scale",
        "unknown": "tilt",
    }[explanation.cause]
    text = describe(explanation, size)
    if explanation.cause in _CONTRADICTIONS:
        text += _UNUSABLE
    return [Finding(code, text, value=size, unit="rad")]


def prior_violations(values: FloatArray, settings: Settings) -> list[Finding]:
    """Return findings about estimates (m,) that their initial sigma makes all but impossible.

    The filter then corrects too little, and distributes the rest over other states: of a bias that
    is not observable, a tilt makes a false one on the other axis.
    """
    ratio = np.abs(values) / settings.initial_sigma
    groups = (
        ("accel", ACCEL_BIAS, "accelerometer biases changed", "raise their initial sigma"),
        ("gyro", GYRO_BIAS, "gyro biases changed", "raise their initial sigma"),
        (
            "scale",
            settings.layout.AXIS_COLUMN,
            "gyro scale factor and installation errors are",
            "check whether the table log is that of this run, and [imu] scale_sigma",
        ),
    )
    findings = []
    for name, group, subject, advice in groups:
        largest = float(ratio[group].max(initial=0.0))
        if largest > MAX_INITIAL_SIGMAS:
            by = "by " if "changed" in subject else ""
            findings.append(
                Finding(
                    f"prior-{name}",
                    f"{subject} {by}{largest:.2g} initial sigmas; {advice}; do not use any "
                    "estimate",
                    value=largest,
                    limit=MAX_INITIAL_SIGMAS,
                )
            )
    return findings
