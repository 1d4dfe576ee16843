"""What each mode of navigation takes out of the readings.

`conventional` takes the gyro biases from the still segment, `partial` those of a calibration (and
its accelerometer biases, if it has any), `full` its scale factor and installation errors too.
"""

import numpy as np

from rotcli.dataclass import dataclass
from rotcli.errors import CodedText, ResultError
from rotcli.models.base import FixedBase
from rotcli.models.sensors import TriadErrors
from rotcli.navigate.estimate import still_gyro_biases
from rotcli.run.correction import Correction
from rotcli.run.recording import NavigationRun

CONVENTIONAL, FULL = "conventional", "full"


@dataclass(frozen=True, eq=False)
class CompensatedErrors:
    """The sensor errors that are taken out, SI, and what is to be said of them."""

    gyro: TriadErrors
    accel: TriadErrors | None
    warnings: tuple[str, ...] = ()


def rate_mismatch(
    run: NavigationRun, correction: Correction | None, *, allowed: bool
) -> str | None:
    """Return why a calibration is not for this run's axis and rate, None where it is.

    Raises ResultError unless that is allowed.
    """
    if correction is None:
        return None
    found = correction.check_applies(run.axis, run.rate, constant_rate=run.constant_rate)
    if found and not allowed:
        raise ResultError(f"{found}; calibrate at that rate", code="calibration-rate")
    return found


def removed(
    run: NavigationRun,
    base: FixedBase,
    mode: str,
    correction: Correction | None,
    other_rate: str | None,
    *,
    static_named: bool,
) -> CompensatedErrors:
    """Return what a mode removes of a run's readings.

    other_rate: what `rate_mismatch` found. static_named: whether the user named a still segment,
    which not every mode takes.
    """
    if correction is None or mode == CONVENTIONAL:
        turns = run.rate or not run.constant_rate
        text = "the table turns in the window: not a conventional run"
        return CompensatedErrors(still_gyro_biases(run, base), None, (text,) if turns else ())
    gyro = correction.gyro_errors(full=mode == FULL)
    warnings = [other_rate] if other_rate else []
    imu, last = run.imu, run.window.stop - 1
    log = (float(imu.rows), float(imu.time[0]), float(imu.time[-1]))
    ends = np.concatenate([imu.times(slice(k, k + 1)) for k in (run.window.start, last)])
    fitted = correction.check_independent(log, (float(ends[0]), float(ends[1])))
    warnings += [fitted] if fitted else []
    if static_named and run.static is None:
        text = f"the named still segment has no effect: {mode} takes the calibration's biases"
        warnings.append(CodedText("still-segment-unused", text))
    if correction.excluded_biases:
        lacks = ", ".join(correction.excluded_biases)
        warnings.append(f"{correction.path}: contains no {lacks}: not corrected")
    return CompensatedErrors(gyro, TriadErrors(bias=correction.accel_bias), tuple(warnings))
