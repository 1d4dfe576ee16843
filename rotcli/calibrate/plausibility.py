"""Compare a calibration with what the rig allows: size of the errors, noise, length of segments."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rotcli.logs.record import Segment
from rotcli.run.findings import Finding
from rotcli.units import DEG_PER_ROOT_HOUR, PPM, show_span

FloatArray = NDArray[np.float64]

_MAX_SCALE_SIGMAS = 10.0  # times scale_sigma of the rig: no device of the type has such an error
_SIGNIFICANT = 4.0  # sigma by which the value exceeds the limit
_NOISE_FACTOR = 2.0  # of the rig's white noise: figures of a data sheet agree within it
# of the other gyros' ratio to the rig: another unit is 57 or 1000, a scale factor error 1.01
_CHANNEL_FACTOR = 4.0


def check_result(
    path: str,
    values: FloatArray,
    covariance: FloatArray,
    names: Sequence[str],
    scale_sigma: FloatArray | None,
) -> list[Finding]:
    """Return findings of scale factor and installation errors that no device has.

    scale_sigma: (3,) fraction, of the rig; None: nothing is known.
    """
    found = []
    for i in range(3):
        if scale_sigma is None or not scale_sigma[i]:
            continue
        limit = _MAX_SCALE_SIGMAS * float(scale_sigma[i])
        value, sigma = float(values[i]), float(np.sqrt(covariance[i, i]))
        if abs(value) - _SIGNIFICANT * sigma > limit:
            text = (
                f"{path}: {names[i]} is {value / PPM:.5g} ppm, {abs(value) / scale_sigma[i]:.3g} "
                "times scale_sigma of the rig: wrong unit, wrong [imu] mount or [attitude], a "
                "step of the bias between the segments, or a table log of another run"
            )
            found.append(
                Finding(
                    "scale-implausible", text, "warning", names[i], value / PPM, limit / PPM, "ppm"
                )
            )
    return found


def check_segment_lengths(
    path: str, turning: Sequence[Segment], *, earth_known: bool
) -> list[Finding]:
    """Return findings of turning segments of less than one turn."""
    found = []
    for segment in turning:
        turns = abs(segment.angle) / (2.0 * np.pi)
        if turns < 1.0:
            leak = "" if earth_known else ". Uncompensated Earth rate biases the result"
            where = show_span(segment.start, segment.end)
            text = f"{path}: segment {where} covers {turns:.2f} turns, less than one{leak}"
            found.append(Finding("segment-turns", text, "warning", where, turns, 1.0, "turns"))
    return found


def check_white_noise(path: str, estimated: FloatArray, white: FloatArray | None) -> list[Finding]:
    """Return findings of gyros whose white noise differs from the rig's, or from the others'.

    estimated, white: (3,) rad/sqrt(s); white None: the rig has none.
    """
    if white is None or not np.all(white) or not np.all(estimated):
        return []
    ratio = estimated / white
    typical = float(np.median(ratio))
    found = []
    for i, axis in enumerate("xyz"):
        relative = float(ratio[i]) / typical
        if not 1.0 / _CHANNEL_FACTOR < relative < _CHANNEL_FACTOR:
            text = (
                f"{path}: white noise of gyro_{axis} is {ratio[i]:.3g} times angle_random_walk "
                f"({estimated[i] / DEG_PER_ROOT_HOUR:.3g} deg/sqrt(h)), that of the other gyros "
                f"{typical:.3g} times: wrong unit or exchanged columns"
            )
            where = f"gyro_{axis}"
            found.append(
                Finding("noise-of-one-gyro", text, "warning", where, relative, _CHANNEL_FACTOR)
            )
    if not 1.0 / _NOISE_FACTOR < typical < _NOISE_FACTOR:
        text = (
            f"{path}: white noise of the log is {typical:.2g} times angle_random_walk; the sigmas "
            "use the rig"
        )
        found.append(Finding("noise-figures", text, "warning", "gyro", typical, _NOISE_FACTOR))
    return found
