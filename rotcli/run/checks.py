"""The table of checks: which check a command makes, and how severe its finding is.

Functions in `rotcli.run` and in the capabilities compare and return findings; every command passes
them through `judge`, which takes the severity from this table. The table is generated into the
reference documentation by `python -m rotcli.run.checks`.
"""

import sys
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

from rotcli.run.findings import CheckError, Finding, Severity

Command = Literal["calibrate", "navigate", "observe", "srins", "laboratory"]
COMMANDS: tuple[Command, ...] = ("calibrate", "navigate", "observe", "srins", "laboratory")


@dataclass(frozen=True)
class Check:
    """One row: code, comparison, limit with its reason, and the severity for each command.

    None: the command does not make the check, and a finding of it is dropped.
    """

    code: str
    compares: str
    limit: str
    calibrate: Severity | None = None
    navigate: Severity | None = None
    observe: Severity | None = None
    srins: Severity | None = None
    laboratory: Severity | None = None

    def severity(self, command: Command) -> Severity | None:
        """Return the severity of the check's finding for a command."""
        result: Severity | None = getattr(self, command)
        return result


CHECKS: tuple[Check, ...] = (
    Check(
        "segment-rate",
        "table angle of a named segment with a straight line",
        "resolution of the encoder, ripple of 1 ms times the rate",
        "error",
        "error",
    ),
    Check(
        "segment-records",
        "number of table records in a named segment",
        "10: a line through fewer shows no ramp",
        "error",
        "error",
    ),
    Check(
        "segment-outside",
        "named segment with the span of the logs",
        "0.1 s: logs may end a few samples before a round number",
        "error",
        "error",
    ),
    Check(
        "still-segment-turns",
        "table angle covered by the segment set as [stages] static",
        "0.01 deg, twice the resolution of the encoder, 1e-4 deg/s over the segment",
        "error",
        "error",
    ),
    Check(
        "turning-segment-still",
        "table angle covered by a segment set as [stages] rotation",
        "0.01 deg, twice the resolution of the encoder, 1e-4 deg/s over the segment",
        "error",
        "error",
    ),
    Check("no-still-segment", "still segments found", "5 s", "error", "error"),
    Check("no-turning-segment", "turning segments found", "5 s", "error", "error"),
    Check("no-window", "time that remains for navigation", "1 s", navigate="error"),
    Check("window-samples", "samples of the window", "4, of the quadrature", navigate="error"),
    Check(
        "segment-shortened",
        "named segment with the part of it at constant rate",
        "1 s: less is a ramp",
        "warning",
        "warning",
    ),
    Check(
        "table-coverage",
        "window with the span of the table log",
        "1 s",
        observe="warning",
    ),
    Check(
        "rotation-axis",
        "direction of the mean gyro rate with the table axis",
        "45 deg, and 3 deg/s perpendicular to the axis: twice the largest turn-on bias",
        "error",
        "error",
        "error",
        laboratory="error",
    ),
    Check(
        "rotation-sense",
        "sense of the gyro rate with that of the table",
        "opposite sign at half the table rate or more",
        "error",
        "error",
        "error",
        laboratory="error",
    ),
    Check(
        "rotation-rate",
        "mean gyro rate with the table rate",
        "20 % of the rate and a turn-on bias of 1.5 deg/s: more is a wrong unit or a dead gyro",
        "error",
        "error",
        "error",
        laboratory="error",
    ),
    Check(
        "turning-without-table",
        "gyro readings with those of the still segment, where no table log is present",
        "3 deg/s over a second (10 deg/s without a still segment)",
        navigate="error",
        laboratory="error",
    ),
    Check(
        "segment-moving",
        "means over a second with the median of the still segment",
        "1 deg/s or 1 m/s^2, ten times the in-run bias of MEMS sensors",
        "error",
        "error",
        "error",
    ),
    Check(
        "segment-disturbed",
        "neighbouring seconds, and scatter, with their typical size in the still segment",
        "7 times typical, 0.02 deg/s or 0.01 m/s^2 at least",
        "warning",
        "warning",
        "warning",
    ),
    Check(
        "rest-readings",
        "gyro mean and noise at rest with plausible ones and the rig's angle_random_walk",
        "3 deg/s; noise 1/25 to 20 times the rig's",
        "warning",
        "warning",
        "warning",
    ),
    Check(
        "gravity-size",
        "size of the mean specific force with gravity",
        "25 %: a wrong unit",
        "warning",
        "error",
        "error",
        "error",
    ),
    Check(
        "gravity-scale",
        "size of the mean specific force with gravity",
        "3 %: scale errors of uncalibrated MEMS accelerometers",
        "warning",
        "warning",
        "warning",
        "warning",
    ),
    Check(
        "gravity-reversed",
        "direction of the mean specific force with gravity in [attitude]",
        "150 deg: the opposite sign",
        "warning",
        "error",
        "error",
        "error",
    ),
    Check(
        "gravity-direction",
        "direction of the mean specific force with gravity in [attitude]",
        "30 deg: a wrong axis",
        "warning",
        "error",
        "error",
        "error",
    ),
    Check(
        "attitude-tilt",
        "direction of the mean specific force with gravity in [attitude]",
        "3 deg: accelerometer biases of 50 mg",
        "warning",
        "warning",
        None,
        "warning",
    ),
    Check(
        "clock-lag",
        "changes of the gyro rate with those of the table rate",
        "third of a sample and 4 sigma: half a sample is the lag of means read as instants",
        "warning",
        "warning",
        "warning",
        "warning",
        laboratory="warning",
    ),
    Check(
        "clock-lag-large",
        "changes of the gyro rate with those of the table rate",
        "2 samples: the ramps then reach into the segments",
        "error",
        "warning",
        "warning",
        "warning",
        laboratory="error",
    ),
    Check(
        "segment-turns",
        "table angle covered by a turning segment",
        "1 turn: uncompensated Earth rate averages out over full turns only",
        "warning",
    ),
    Check("one-rate", "rates of the segments", "0.1 % apart", "error"),
    Check(
        "noise-figures",
        "white noise of the log with the rig's angle_random_walk",
        "factor 2",
        "warning",
    ),
    Check(
        "noise-figures-missing",
        "noise figures present in the rig",
        "angle_random_walk and bias_instability",
        laboratory="warning",
    ),
    Check(
        "noise-figures-small",
        "chi-squared of the fit with its distribution",
        "99 % quantile: the noise figures are too small or the model is wrong; sigmas are enlarged",
        laboratory="warning",
    ),
    Check(
        "noise-figures-large",
        "chi-squared of the fit with its distribution",
        "1 % quantile: the noise figures are too large",
        laboratory="warning",
    ),
    Check(
        "scale-nonlinear",
        "straight line over the rates with cubic, asym+odd and free values",
        "p below 1 %",
        laboratory="warning",
    ),
    Check(
        "scale-one-sign",
        "signs of the table rates",
        "both signs: asymmetry needs them",
        laboratory="warning",
    ),
    Check(
        "scale-hysteresis",
        "readings after a lower rate with those after a higher one",
        "3 sigma",
        laboratory="warning",
    ),
    Check(
        "thermal-one-way",
        "heating with cooling in the logs",
        "both: one way does not separate drift from temperature",
        laboratory="warning",
    ),
    Check(
        "temperature-gap",
        "distance of neighbouring temperatures with the range",
        "40 % of the range: the curve is not tested there",
        laboratory="warning",
    ),
    Check(
        "thermal-hysteresis",
        "readings of heating with those of cooling",
        "p below 1 %",
        laboratory="warning",
    ),
    Check(
        "warm-up-unknown",
        "time constant of the warm-up with the record",
        "half the record, sigma of a factor 2",
        laboratory="warning",
    ),
    Check(
        "warm-up-not-over",
        "start of a still segment with the warm-up time",
        "warm-up time of the result",
        calibrate="warning",
    ),
    Check(
        "temperature-changes",
        "temperature over the segments",
        "1 degC: some 10 deg/h of a MEMS gyro",
        "warning",
    ),
    Check(
        "segment-overlap",
        "limits of the named segments with each other",
        "0.1 s: no sample may count twice",
        "error",
    ),
    Check(
        "segment-clipped",
        "gyro readings with gyro_range of the rig",
        "1 % of the samples of a segment; it is not used",
        "warning",
    ),
    Check(
        "rotation-not-followed",
        "gyros with the table inside a segment",
        "20 % of the rate over 0.5 s",
        "error",
    ),
    Check("zero-rows", "rows whose six readings are all zero", "none", "warning"),
    Check(
        "straight-rows",
        "rows on a straight line with the rows before, in all six readings",
        "5 rows in succession: noise does it with a chance below 1e-12",
        "warning",
    ),
    Check(
        "copied-rows",
        "rows that repeat earlier rows, in all six readings",
        "5 rows in succession",
        "warning",
    ),
    Check(
        "repeated-rows",
        "rows equal to the row before, in all six readings",
        "20 % of the rows: a logger faster than the sensor",
        "warning",
    ),
    Check(
        "fit-contradicted",
        "means of parts of the segments with one bias and one scale factor",
        "chi-squared, false alarms 0.1 %",
        "warning",
    ),
    Check(
        "residual-harmonics",
        "residuals with sines of the table angle, once and twice per turn",
        "chi-squared of 12 degrees of freedom, false alarms 0.1 %",
        "warning",
    ),
    Check(
        "scale-implausible",
        "scale factor and installation errors with scale_sigma of the rig",
        "10 times, and 4 sigma",
        "warning",
    ),
    Check(
        "noise-of-one-gyro",
        "white noise of one gyro with that of the others, relative to the rig",
        "factor 4: another unit has 57 or 1000",
        "warning",
    ),
    Check(
        "encoder-eccentricity",
        "table angle with a sine of itself",
        "0.03 deg: 20 ppm of the rate over a minute at 30 deg/s",
        "warning",
    ),
    Check("uneven-motion", "motion of the table with constant rates", "no two rates", "note"),
    Check(
        "clock-rate",
        "lags at changes of the table rate far apart",
        "50 ppm and 4 sigma: crystals differ by 30 ppm",
        "warning",
        "warning",
        "warning",
        "warning",
        laboratory="warning",
    ),
    Check(
        "no-slow-noise",
        "noise figures present in the rig",
        "bias_instability, rate_random_walk or a Gauss-Markov process",
        "warning",
    ),
    Check(
        "rms-unexpected",
        "RMS errors of a navigation with those that the noise figures imply",
        "p of the run 1e-3: one clean run in a thousand",
        navigate="warning",
    ),
    Check(
        "gyro-bias-changed",
        "mean corrected gyro output of the window with its sigma",
        "p 1e-3, three axes",
        navigate="warning",
    ),
    Check(
        "accel-bias-changed",
        "accelerometers of the window with those of the still segment",
        "p 1e-3, three axes; where gravity turns, a scale factor of 0.3 %",
        navigate="warning",
    ),
    Check(
        "level-unexpected",
        "level of the turning table from the accelerometers with [attitude]",
        "5 sigma, at least 0.02 deg; where gravity turns, a scale factor of 0.3 %",
        navigate="warning",
    ),
    Check(
        "window-disturbed",
        "means of a second of the window with the other seconds",
        "p 1e-3 of the largest residual of the window",
        navigate="warning",
    ),
    Check(
        "noise-unexpected",
        "scatter of the means of a second with the noise figures",
        "half to twice, p 1e-3 of six channels",
        navigate="warning",
    ),
    Check(
        "samples-not-measured",
        "samples of the window with each other, with a straight line, with zero",
        "runs of 5 samples; zeros from 1",
        navigate="warning",
    ),
)

CHECK_BY_CODE = {check.code: check for check in CHECKS}


def judge(
    command: Command, findings: Iterable[Finding], *, lenient: bool = False
) -> tuple[Finding, ...]:
    """Return the findings with the severity that the table has for the command.

    Findings of checks that the command does not make are dropped. lenient: errors become
    warnings. Raises CheckError for the first error, KeyError for a code that the table lacks.
    """
    judged = []
    for finding in findings:
        severity = CHECK_BY_CODE[finding.code].severity(command)
        if severity is None:
            continue
        if severity == "error" and not lenient:
            path, _, message = finding.text.partition(": ")
            raise CheckError(path, finding.code, message)
        judged.append(replace(finding, severity="warning" if severity == "error" else severity))
    return tuple(judged)


def to_markdown() -> str:
    """Return the table of checks as a Markdown page for docs/reference."""
    lines = [
        "# Checks",
        "",
        "Which check a command makes, and the severity of its finding. An *error* ends the command",
        "without a result, a *warning* is printed and stored in it, a *note* is stored only.",
        "`laboratory` means `scale` and `thermal`.",
        "",
        "| check | compares | limit | " + " | ".join(COMMANDS) + " |",
        "| --- | --- | --- |" + " --- |" * len(COMMANDS),
    ]
    for check in CHECKS:
        severities = " | ".join(check.severity(command) or "-" for command in COMMANDS)
        lines.append(f"| `{check.code}` | {check.compares} | {check.limit} | {severities} |")
    return "\n".join([*lines, ""])


if __name__ == "__main__":
    sys.stdout.write(to_markdown())
