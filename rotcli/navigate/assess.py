"""Assess a navigated run: its residuals, its expected errors and the verdict, in one call."""

from dataclasses import replace

from rotcli.dataclass import dataclass
from rotcli.models.numerics.blas_threads import one_thread
from rotcli.navigate.companions import still_bias_finding
from rotcli.navigate.earth_rate import earth_rate_findings, window_harmonics
from rotcli.navigate.estimate import Summary, warn_wrong_rate
from rotcli.navigate.expected import Expectation, NavigationSetup, expectation
from rotcli.navigate.modes import CONVENTIONAL, FULL, CompensatedErrors
from rotcli.navigate.place import Place
from rotcli.navigate.residuals import (
    WindowMeans,
    WindowResiduals,
    still_accelerometers,
    window_residuals,
)
from rotcli.navigate.verdict import Verdict, judge
from rotcli.rig.rig import Rig
from rotcli.run import checks
from rotcli.run.consistency.harmonics import Harmonics
from rotcli.run.correction import Correction
from rotcli.run.findings import Finding
from rotcli.run.recording import NavigationRun

# Findings about samples that explain errors of the navigation as well: one cause is enough.
_DISTURBED = {"copied-rows", "samples-not-measured", "table-angle", "clock-lag-large"}


@dataclass(frozen=True, eq=False)
class Assessment:
    """What a navigated run should have had next to what it has; warnings: of a wrong mean rate.

    harmonics: sines of the table angle in the gyros; None where the window does not show them.
    """

    residuals: WindowResiduals
    expectation: Expectation
    verdict: Verdict
    warnings: tuple[str, ...]
    harmonics: Harmonics | None = None


def assess(
    run: NavigationRun,
    place: Place,
    rig: Rig,
    removed: CompensatedErrors,
    correction: Correction | None,
    summary: Summary,
    means: WindowMeans,
    *,
    hold_height: bool,
) -> Assessment:
    """Return the assessment of a run that was navigated; summary: its errors; means: readings."""
    mode = summary.mode
    still = None
    if run.static is not None:
        ends = run.static.start, run.static.stop - 1
        first, last = (float(run.imu.times(slice(k, k + 1))[0]) for k in ends)
        still = first, last + run.imu.interval
    setup = NavigationSetup(
        run=run,
        place=place,
        rig=rig,
        mode=mode,
        correction=None if mode == CONVENTIONAL else correction,
        still=still,
        hold_height=hold_height,
    )
    residuals = window_residuals(run, place.base, removed.gyro, removed.accel, means)
    rest = still_accelerometers(run, rig, place.base, removed.accel)
    with one_thread():
        expected = expectation(setup, residuals, rest)
    warnings: tuple[str, ...] = ()
    if mode == FULL and expected.tests.gyro_mean is None:
        warnings = warn_wrong_rate(run, residuals.mean_gyro)
    known = {f.code for f in (*run.findings, *residuals.findings)}
    disturbed = bool(known & _DISTURBED)
    rms = summary.rms
    verdict = judge(run.imu.path, mode, expected, rms, run.rate, disturbed=disturbed)
    harmonics = window_harmonics(run, rig, place.base, means)
    earth: tuple[Finding, ...] = ()
    if not disturbed and not any(f.code == "window-disturbed" for f in verdict.findings):
        earth = earth_rate_findings(run, rig, place.base, harmonics)
    prior = rig.imu.figure("accel_bias_sigma")
    still_findings: list[Finding] = []
    if rest is not None and prior is not None:
        turning = expected.tests.level is not None
        still_findings = still_bias_finding(run.imu.path, rest, prior, turning)
    raw = (*residuals.findings, *still_findings, *earth, *verdict.findings)
    findings = checks.judge("navigate", raw)
    verdict = replace(verdict, findings=findings)
    return Assessment(residuals, expected, verdict, warnings, harmonics)
