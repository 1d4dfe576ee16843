"""Explain accelerometer readings that contradict the set-up: attitude, lever arm, or sensor errors.

A ZUPT filter puts every contradiction of the accelerometers into tilts and biases. The readings
themselves distinguish the causes, because each has its own dependence on the table's angle theta
and rate w:

- a table off its nominal attitude adds a constant vector in n: `C_sb(theta) dg`;
- an IMU off the axis adds `w^2 u x (u x r)`;
- accelerometer scale factor and orthogonality errors add `M C_sb(theta) g`, M symmetric: twice the
  table's angle;
- a bias is constant.

Each model, with a bias, is fitted to the readings by least squares. The cause is the model that
explains nearly as much as all of them together.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.models.rotation import axis_rotation, skew
from rotcli.units import DEG, FloatArray

if TYPE_CHECKING:
    from rotcli.observe.zupt.model import Settings

Cause = Literal["attitude", "lever arm", "accelerometers", "unknown"]

# Of the variance that all models explain together: one that explains as much is the cause.
MIN_EXPLAINED = 0.9
_NEARLY_AS_MUCH = 0.05  # of the explained variance, which a simpler model may explain less
# Below this share of the residual variance there is nothing to explain: an angle of 0.3 deg (the
# tilt that is reported) adds 0.05 m/s^2, 10 % of the variance of readings with noise of 0.11 m/s^2.
MIN_VARIANCE_SHARE = 0.02
_ROUNDING = 1e-9  # of the mean square of the residuals, in the variance that is left of them
MAX_SAMPLES = 100_000  # of a log, evenly spaced: 5 s of CPU time for 10 hours
_RATE_TIME = 0.1  # s over which the table's rate is a mean
# Readings near a change of rate contain the tangential acceleration, which is not modelled.
_MAX_RATE_CHANGE = 0.01  # of the largest rate, within _RATE_TIME

_MIN_EXCITATION = 0.1  # of gravity (RMS), by which a scale factor error must be excited

_WRONG_SIGN = 2.0  # scale factor error of -200 %: the reading has the other sign
_SIGN_TOLERANCE = 0.1  # of that: scale factor errors of accelerometers are below it

_SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_GROUPS: dict[str, slice] = {
    "bias": slice(0, 3),
    "attitude": slice(3, 5),
    "lever arm": slice(5, 7),
    "accelerometers": slice(7, 13),
}
_PARAMETERS = 13


@dataclass(frozen=True, eq=False)
class Explanation:
    """The cause of a contradiction, and what each model gives.

    explained: share of the explicable variance by each cause alone. tilt: rad, between estimated
    and nominal gravity. lever_arm: (3,) m, perpendicular to the axis, beyond that of the settings.
    scale_errors: (3,) of the accelerometers, fractions; NaN where gravity does not excite them.
    """

    cause: Cause
    explained: dict[str, float]
    tilt: float
    lever_arm: FloatArray
    scale_errors: FloatArray


class Evidence:
    """Normal equations of the models, from readings that come chunk by chunk."""

    def __init__(self, settings: "Settings", interval: float) -> None:
        self._settings, self._interval = settings, interval
        self._A = np.zeros((_PARAMETERS, _PARAMETERS))
        self._b = np.zeros(_PARAMETERS)
        self._square, self._count = 0.0, 0
        gravity_b = settings.C_nb.T @ np.array([0.0, 0.0, settings.gravity])
        self._gravity_b = gravity_b
        # Two directions perpendicular to gravity, in b: the tilts.
        self._tilts = np.linalg.svd(gravity_b[None])[2][1:].T
        symmetric = np.zeros((len(_SYMMETRIC), 3, 3))
        for k, (i, j) in enumerate(_SYMMETRIC):
            symmetric[k, i, j] = symmetric[k, j, i] = 1.0
        self._symmetric = symmetric

    def add(self, accel: FloatArray, theta: FloatArray, step: int) -> None:
        """Add readings (n, 3), m/s^2, at the table angles (n,), rad; every `step`-th is used."""
        s, dt = self._settings, self._interval
        half = max(1, round(0.5 * _RATE_TIME / dt))
        if len(theta) <= 4 * half:
            return
        rate = np.zeros(len(theta))
        rate[half:-half] = (theta[2 * half :] - theta[: -2 * half]) / (2 * half * dt)
        change = np.abs(rate[2 * half :] - rate[: -2 * half])
        constant = np.zeros(len(theta), dtype=bool)
        constant[2 * half : -2 * half] = (
            change[half:-half] <= _MAX_RATE_CHANGE * np.abs(rate).max() + 1e-6
        )
        at = np.flatnonzero(constant)[::step]
        if not len(at):
            return
        angle, w = theta[at], rate[at]
        shorter = np.ones(len(at))
        if s.samples_are_means:  # the mean over a sample is at its middle and shorter
            angle = angle - 0.5 * dt * w
            shorter = np.sinc(0.5 * dt * w / np.pi)
        u, along = skew(s.axis), np.outer(s.axis, s.axis)
        C_sb = axis_rotation(s.axis, -angle) - along
        C_sb *= shorter[:, None, None]
        C_sb += along
        force = C_sb @ self._gravity_b
        centripetal = (w * w)[:, None, None] * (u @ u)
        columns = np.empty((len(at), 3, _PARAMETERS))
        columns[:, :, _GROUPS["bias"]] = np.eye(3)
        columns[:, :, _GROUPS["attitude"]] = C_sb @ self._tilts
        columns[:, :, _GROUPS["lever arm"]] = centripetal @ s.lever_axes
        columns[:, :, _GROUPS["accelerometers"]] = np.einsum("kij,nj->nik", self._symmetric, force)
        residual = accel[at] - force - centripetal @ np.array(s.lever_arm)
        A, z = columns.reshape(-1, _PARAMETERS), residual.reshape(-1)
        self._A += A.T @ A
        self._b += A.T @ z
        self._square += float(z @ z)
        self._count += len(z)

    def explain(self) -> Explanation:
        """Return the cause that the readings show."""
        causes: tuple[Cause, ...] = ("attitude", "lever arm", "accelerometers")
        if not self._count:
            nothing: dict[str, float] = dict.fromkeys(causes, 0.0)
            return Explanation("unknown", nothing, 0.0, np.zeros(3), np.zeros(3))
        bias = self._fit(["bias"])[0]
        every = self._fit(list(_GROUPS))[0]
        fits = {cause: self._fit(["bias", cause]) for cause in causes}
        gain = bias - every
        explained = {
            cause: (bias - fits[cause][0]) / gain if gain > 0.0 else 0.0 for cause in causes
        }
        # The simplest model first: a tilt of the axis changes the part of gravity that rotates as
        # equal scale factor errors of two accelerometers do.
        limit = max(MIN_EXPLAINED, max(explained.values()) - _NEARLY_AS_MUCH)
        enough = [cause for cause in causes if explained[cause] >= limit]
        rounding = _ROUNDING * self._square / self._count
        clear = gain > max(MIN_VARIANCE_SHARE * bias, rounding) and bool(enough)
        tilt = fits["attitude"][1][_GROUPS["attitude"]]
        arm = fits["lever arm"][1][_GROUPS["lever arm"]]
        scale = self._excited(fits["accelerometers"][1])[_GROUPS["accelerometers"]][:3]
        return Explanation(
            cause=enough[0] if clear else "unknown",
            explained={str(cause): share for cause, share in explained.items()},
            tilt=float(np.arctan(np.hypot(*tilt) / self._settings.gravity)),
            lever_arm=self._settings.lever_axes @ arm,
            scale_errors=scale,
        )

    def _excited(self, parameters: FloatArray) -> FloatArray:
        """Return the parameters (13,), NaN where the readings contain nothing of them.

        An accelerometer perpendicular to gravity shows no scale factor error.
        """
        size = np.sqrt(np.diag(self._A) / max(self._count, 1)) / self._settings.gravity
        return np.where(size > _MIN_EXCITATION, parameters, np.nan)

    def _fit(self, groups: Sequence[str]) -> tuple[float, FloatArray]:
        """Return the residual variance and the parameters (13,) of some models together."""
        index = np.concatenate([np.arange(_PARAMETERS)[_GROUPS[g]] for g in groups])
        A, b = self._A[np.ix_(index, index)], self._b[index]
        # A still or level table excites some parameters not at all: least squares of least size.
        scale = np.sqrt(np.maximum(np.diag(A), 1e-300))
        x = np.linalg.pinv(A / np.outer(scale, scale), rcond=1e-9, hermitian=True) @ (b / scale)
        parameters = np.zeros(_PARAMETERS)
        parameters[index] = x / scale
        variance = (self._square - float(b @ parameters[index])) / self._count
        return max(variance, 0.0), parameters


def describe(explanation: Explanation, tilt: float) -> str:
    """Return the finding in words; tilt: rad, estimated by the filter."""
    size = f"{tilt / DEG:.2g} deg"
    e = explanation
    if e.cause == "attitude":
        return (
            f"the table is {size} off [attitude]; the estimated attitude is used; correct "
            "[attitude]"
        )
    if e.cause == "lever arm":
        arm = ", ".join(f"{x:.3f}" for x in e.lever_arm + 0.0)
        return (
            f"the accelerometers contradict [imu] lever_arm: with ({arm}) m more perpendicular to "
            "the axis they agree with [attitude]; correct [imu] lever_arm, or estimate it"
        )
    if e.cause == "accelerometers":
        flipped = [
            f"accel_{axis}"
            for axis, x in zip("xyz", e.scale_errors, strict=True)
            if abs(x + _WRONG_SIGN) < _SIGN_TOLERANCE
        ]
        if flipped:
            return (
                f"{' and '.join(flipped)} read the gravity that turns with the table with the "
                "wrong sign; correct [imu] mount or the columns"
            )
        errors = ", ".join(
            f"{axis} {100.0 * x:.2g} %"
            for axis, x in zip("xyz", e.scale_errors, strict=True)
            if np.isfinite(x)
        )
        return (
            "the gravity that the accelerometers read changes with the table angle: scale factor "
            f"errors ({errors}) explain it, not [attitude]; calibrate the accelerometers"
        )
    return (
        f"the estimated tilt differs by {size} from [attitude] and is used. Possible causes: "
        "wrong [attitude], missing [imu] lever_arm, accelerometer scale factor errors"
    )
