"""Judge a navigation run by its expected errors: ratios, p values, findings.

One clean run in a thousand has p_run below 1e-3. The hint follows the error that leads:
azimuth alone: bias along the axis; position and velocity with quiet tilt: attitude of the rig or
accelerometers; pitch and roll: Earth rate (azimuth, axes, signs); height: gravity. A disturbed
second comes first: it explains the RMS. Residuals of other scatter than the noise figures say are
reported where their ratio leaves 1/2 to 2.
"""

import math

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.lazy import lazily
from rotcli.models.expected.companions import P_BLOCK, BlockResiduals
from rotcli.models.expected.motion import ErrorName
from rotcli.models.expected.statistics import P_WARN, run_p_value
from rotcli.navigate.companions import Companions
from rotcli.navigate.expected import Expectation
from rotcli.run.findings import Finding
from rotcli.units import DEG, DEG_PER_HOUR, FloatArray, digits, show_time

with lazily():
    import statistics


# Of the 1-sigma scatter of residuals over that of the noise figures: the limits within which
# data-sheet figures of one model of IMU usually lie.
MAX_SCATTER_RATIO = 2.0
_MAX_TIMES = 6  # disturbed times that a text names
_GAP_BLOCKS = 2  # disturbed blocks closer than this are one disturbance

_NAMES: tuple[str, ...] = (
    "latitude",
    "longitude",
    "height",
    "v north",
    "v east",
    "v up",
    "pitch",
    "roll",
)
_NAMES += ("azimuth", "horizontal position", "horizontal velocity")
_UNITS = ("m", "m", "m", "m/s", "m/s", "m/s", "deg", "deg", "deg", "m", "m/s")
_SI = np.array([1.0] * 6 + [DEG] * 3 + [1.0] * 2)

_HINTS = {
    "azimuth": "the gyro bias along the vertical is not the calibration's; calibrate again",
    "tilt": "Earth rate is compensated wrongly ([attitude] azimuth, [imu] mount, axes or signs) "
    "or the gyro biases have changed",
    "position": "[attitude] pitch and roll differ from the table's, or the accelerometers changed",
    "height": "gravity does not fit: check [site] latitude and height and the vertical "
    "accelerometer",
}


@dataclass(frozen=True, eq=False)
class Verdict:
    """Observed RMS against expected: ratio, p value (11,), NaN where not judged; p_run; findings.

    rms: (11,) observed, m, m/s, rad.
    """

    rms: FloatArray
    ratio: FloatArray
    p_values: FloatArray
    p_run: float | None
    findings: tuple[Finding, ...]


def judge(
    path: str,
    mode: str,
    expectation: Expectation,
    rms: FloatArray,
    rate: float,
    *,
    disturbed: bool = False,
) -> Verdict:
    """Return the verdict on the RMS (11,), m, m/s, rad, of a run; path: of its IMU log.

    rate: rad/s, mean table rate of the window. disturbed: whether other findings name samples that
    explain the errors.
    """
    statistics = expectation.statistics
    if statistics is None:
        nothing = np.full(11, np.nan)
        return Verdict(rms, nothing, nothing, None, ())
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(statistics.valid & (statistics.rms > 0.0), rms / statistics.rms, np.nan)
    p = statistics.p_values(rms)
    p_run = run_p_value(p)
    findings: list[Finding] = []
    for kind, blocks in (
        ("gyro", expectation.tests.gyro_blocks),
        ("accel", expectation.tests.accel_blocks),
    ):
        if blocks is not None:
            findings += _disturbances(path, kind, blocks) + _scatter(path, kind, blocks)
    disturbed = disturbed or any(f.code == "window-disturbed" for f in findings)
    if p_run < P_WARN:
        findings.append(_rms_finding(path, mode, statistics.rms, rms, p, disturbed))
    findings += _mean_findings(path, expectation.tests)
    noisy = {f.where for f in findings if f.code == "noise-unexpected"}
    changed = _accel_findings(path, rate, expectation.tests)
    findings += [f for f in changed if f.where not in noisy]
    return Verdict(rms, ratio, p, None if np.isnan(p_run) else p_run, tuple(findings))


def _rms_finding(
    path: str, mode: str, expected: FloatArray, rms: FloatArray, p: FloatArray, disturbed: bool
) -> Finding:
    """Return the finding of an RMS that the noise figures do not explain."""
    lead = int(np.nanargmin(p))
    concerned = [k for k in np.argsort(p) if p[k] < P_WARN / 7.0 and k != lead]
    others = ", ".join(_NAMES[k] for k in concerned[:4])
    shown, due = rms[lead] / _SI[lead], expected[lead] / _SI[lead]
    text = (
        f"{path}: {mode}: {_NAMES[lead]} RMS {digits(float(shown))} {_UNITS[lead]}, "
        f"{digits(float(due))} expected (p {p[lead]:.0e})"
    )
    text += f", also {others}. " if others else ". "
    text += "Likely cause: " + ("the disturbance above" if disturbed else _hint(lead, p))
    return Finding(
        "rms-unexpected",
        text,
        where=_NAMES[lead],
        value=float(shown),
        limit=float(due),
        unit=_UNITS[lead],
    )


def _hint(lead: int, p: FloatArray) -> str:
    """Return the likely kind of cause of the error that leads."""
    if lead in (ErrorName.HEIGHT, ErrorName.V_UP):
        return _HINTS["height"]
    if lead == ErrorName.AZIMUTH:
        return _HINTS["azimuth"]
    tilt = min(p[ErrorName.PITCH], p[ErrorName.ROLL])
    if lead in (ErrorName.PITCH, ErrorName.ROLL) or tilt < P_WARN:
        return _HINTS["tilt"]
    return _HINTS["position"]


def _mean_findings(path: str, tests: Companions) -> list[Finding]:
    """Return the finding of a mean corrected gyro output that is not zero."""
    mean = tests.gyro_mean
    if mean is None or mean.p_value >= P_WARN:
        return []
    axis = int(np.argmax(np.abs(mean.value) / mean.sigma))
    value, sigma = (float(x[axis]) / DEG_PER_HOUR for x in (mean.value, mean.sigma))
    text = (
        f"{path}: gyro_{'xyz'[axis]} reads {digits(value)} deg/h on average after correction, "
        f"{digits(sigma)} deg/h expected (p {mean.p_value:.0e}). The bias is not the "
        "calibration's; calibrate again"
    )
    where = f"gyro_{'xyz'[axis]}"
    return [Finding("gyro-bias-changed", text, where=where, value=value, limit=sigma, unit="deg/h")]


def _accel_findings(path: str, rate: float, tests: Companions) -> list[Finding]:
    """Return the findings of a table that is not level, or of accelerometers that changed.

    A change that comes with the rate is the acceleration of an IMU next to the axis, w^2 r.
    """
    findings = []
    found, mean = tests.level, tests.accel_mean
    if found is not None and found.significant:
        pitch, roll, sigma = found.pitch / DEG, found.roll / DEG, found.sigma / DEG
        text = (
            f"{path}: over complete turns the accelerometers find pitch {pitch:.3f} deg, roll "
            f"{roll:.3f} deg (+- {digits(sigma, 2)} deg), free of their biases. [attitude] says "
            "otherwise; correct it"
        )
        size = float(np.linalg.norm(found.gravity))
        findings.append(
            Finding("level-unexpected", text, where="attitude", value=size, unit="m/s^2")
        )
    if mean is not None and mean.p_value < P_WARN:
        axis = int(np.argmax(np.abs(mean.value) / mean.sigma))
        value, sigma = float(mean.value[axis]), float(mean.sigma[axis])
        where = f"accel_{'xyz'[axis]}"
        text = (
            f"{path}: {where} reads {digits(value)} m/s^2 more in the window than in the still "
            f"segment, {digits(sigma)} expected (p {mean.p_value:.0e}). "
        )
        if rate:
            arm = abs(value) / rate**2
            text += f"An IMU {digits(arm, 2)} m next to the axis reads this; check [imu] lever_arm"
        else:
            text += "The accelerometer changed or the table tilted; check both"
        findings.append(
            Finding("accel-bias-changed", text, where=where, value=value, limit=sigma, unit="m/s^2")
        )
    return findings


def _disturbances(path: str, kind: str, blocks: BlockResiduals) -> list[Finding]:
    """Return the finding of disturbed seconds, with their times."""
    if not blocks.disturbed:
        return []
    times = _merged(blocks.disturbed, blocks.length)
    shown = ", ".join(times[:_MAX_TIMES]) + (", …" if len(times) > _MAX_TIMES else "")
    channel = f"{kind}_{'xyz'[blocks.axis]}"
    text = (
        f"{path}: the {'gyros are' if kind == 'gyro' else 'accelerometers are'} disturbed at "
        f"{shown}; {channel} by {digits(blocks.maximum, 2)} sigma in the second from "
        f"{show_time(blocks.at)} s. Spike, shock, or samples that were not measured; check the "
        "log there or exclude this part"
    )
    return [
        Finding(
            "window-disturbed",
            text,
            where=channel,
            value=blocks.maximum,
            limit=_limit_sigmas(),
            unit="sigma",
        )
    ]


def _limit_sigmas() -> float:
    """Return the size (sigma) that the largest of 3 x 300 clean residuals exceeds in P_BLOCK."""
    return -statistics.NormalDist().inv_cdf(0.5 * P_BLOCK / 900.0)


def _merged(starts: tuple[float, ...], length: float) -> list[str]:
    """Return the spans of disturbed blocks as texts, neighbours together.

    >>> _merged((131.0, 132.0, 321.0), 1.0)
    ['131 to 133 s', '321 to 322 s']
    """
    spans: list[list[float]] = []
    for start in starts:
        if spans and start - spans[-1][1] < _GAP_BLOCKS * length:
            spans[-1][1] = start + length
        else:
            spans.append([start, start + length])
    return [f"{show_time(a)} to {show_time(b)} s" for a, b in spans]


def _scatter(path: str, kind: str, blocks: BlockResiduals) -> list[Finding]:
    """Return the finding of residuals that scatter otherwise than the noise figures say."""
    if blocks.disturbed:
        return []
    ratio = np.sqrt(blocks.chi2_per_dof)
    worst = int(np.argmax(np.abs(np.log(np.maximum(ratio, 1e-9)))))
    value = float(ratio[worst])
    clear = _chi2_p(float(blocks.chi2_per_dof[worst]), blocks.count) < P_WARN
    if 1.0 / MAX_SCATTER_RATIO <= value <= MAX_SCATTER_RATIO or not clear:
        return []
    keys = "angle_random_walk, bias_instability" if kind == "gyro" else "velocity_random_walk"
    text = (
        f"{path}: {kind}_{'xyz'[worst]} scatters {digits(value, 2)} times as much from second to "
        f"second as [imu] {keys} say; check its unit and scale, or the noise figures"
    )
    return [
        Finding(
            "noise-unexpected",
            text,
            where=f"{kind}_{'xyz'[worst]}",
            value=value,
            limit=MAX_SCATTER_RATIO,
        )
    ]


def _chi2_p(per_dof: float, dof: int) -> float:
    """Return p of the least likely of six chi2 figures, both tails.

    The cube root of chi2 is nearly Gaussian (Wilson and Hilferty, PNAS 17 (1931) 684).
    """
    spread = 2.0 / (9.0 * dof)
    score = (per_dof ** (1.0 / 3.0) - (1.0 - spread)) / spread**0.5
    return min(1.0, 6.0 * math.erfc(abs(score) / math.sqrt(2.0)))
