"""Test all segments of a log at constant rate: fit of one bias and one line, residual sines.

The fit is tested on the parts of the segments, the sines of the table angle in their residuals.
Each can cause the other: a step of the bias leaves sines, sines contradict the fit. So one is
removed before the other is judged, and a cause is reported once.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.logs.record import TableLog
from rotcli.models.base import FixedBase
from rotcli.run.consistency.blocks import EarthHarmonics, SegmentBlocks
from rotcli.run.consistency.goodness import FALSE_ALARM, FitTest, check_fit, part_means
from rotcli.run.consistency.harmonics import Harmonics, check_harmonics, residual_harmonics
from rotcli.run.consistency.means import TriadNoise
from rotcli.run.findings import Finding
from rotcli.run.motion import EncoderNoise
from rotcli.units import FloatArray

# of chi-squared: where so much is left without the sines, something else causes them
_LEFT = 0.5
_SCALED = ". The sigmas do not contain this"


@dataclass(frozen=True, eq=False)
class LogFit:
    """A log to be tested.

    table, blocks: log and segments at constant rate. u: (3,) axis in b. base: None leaves the
    Earth rate in the data. noise: of the gyros; known: whether the rig has figures of slow noise.
    azimuth: rad, of the rig. scaled: whether the caller multiplies its sigmas by those of the test.
    explained: whether other findings name samples that would contradict the fit; then no further
    cause is looked for. false_alarm: probability of the test of the fit.
    """

    path: str
    table: TableLog
    blocks: Sequence[SegmentBlocks]
    u: FloatArray
    base: FixedBase | None
    noise: TriadNoise
    encoder: EncoderNoise
    known: bool
    azimuth: float = 0.0
    scaled: bool = True
    explained: bool = False
    false_alarm: float = FALSE_ALARM

    @property
    def earth(self) -> EarthHarmonics:
        """Earth rate in the sensor frame."""
        return EarthHarmonics.of(self.base, self.u)

    def test(self) -> tuple[FitTest, tuple[Finding, ...]]:
        """Return the test of the fit, and the findings of both tests."""
        test = self._fit_test()
        if self.explained:
            return test, self._of_disturbed(test) if self.scaled else ()
        harmonics = self._harmonics(test.steps)
        test = replace(test, harmonics=harmonics)
        varying = self._judged(harmonics)
        if not varying or harmonics is None:
            return test, test.findings
        rest = self._fit_test(harmonics.value)
        i = "xyz".index(varying[0].where[-1])
        before, after = test.gyros[i], rest.gyros[i]
        if after.contradicted and after.chi2 > _LEFT * before.chi2:
            return test, test.findings
        return replace(test, findings=rest.findings), (*rest.findings, *varying)

    def _of_disturbed(self, test: FitTest) -> tuple[Finding, ...]:
        """Return the findings of the fit with the disturbed samples as their cause."""
        findings = []
        for finding in test.findings:
            gyro = test.gyros["xyz".index(finding.where[-1])]
            text = (
                f"{self.path}: {finding.where}: these samples contradict one bias and one scale "
                f"factor (chi-squared {gyro.chi2:.4g}, limit {gyro.limit:.4g}); its sigmas are "
                f"multiplied by {gyro.sigma_factor:.3g}"
            )
            findings.append(replace(finding, text=text))
        return tuple(findings)

    def _fit_test(self, harmonics: FloatArray | None = None) -> FitTest:
        """Test the fit, without the harmonics (4, 3), rad/s, of the table angle."""
        means = part_means(self.blocks, self.table, self.earth, self.u, self.encoder, harmonics)
        flicker = np.array([slow.bias_instability for slow in self.noise.slow])
        check = partial(check_fit, self.path, means, self.noise, self.u)
        return check(
            flicker=flicker,
            judged=self.known,
            scaled=self.scaled,
            false_alarm=self.false_alarm,
        )

    def _harmonics(self, steps: Sequence[float]) -> Harmonics | None:
        noise = self.noise
        return residual_harmonics(
            self.blocks, self.earth, noise.white, noise.slow, steps, known=self.known
        )

    def _judged(self, harmonics: Harmonics | None) -> tuple[Finding, ...]:
        suffix = _SCALED if self.scaled else ""
        return check_harmonics(self.path, harmonics, self.base, self.u, self.azimuth, suffix)
