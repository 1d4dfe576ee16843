"""Compare a calibration with what the rig allows: size of the errors, rates, segments."""

from collections.abc import Sequence

import numpy as np

from rotcli.logs.record import Segment
from rotcli.run.findings import CheckError, Finding
from rotcli.run.recording import SAME_RATE
from rotcli.units import PPM, FloatArray, format_span

MAX_SCALE_SIGMAS = 10.0  # times scale_sigma of the rig: no device of the type has such an error
_SIGNIFICANT = 4.0  # sigma by which the value exceeds the limit


def check_rates(path: str, segments: Sequence[Segment], uneven: Segment | None = None) -> None:
    """Raise CheckError where the rates cannot separate bias and scale factor."""
    if uneven is not None and segments:
        return
    if not any(s.rate for s in segments):
        raise CheckError(path, "no-turning-segment", "no turning segment; record one")
    rates = np.array([s.rate for s in segments])
    if np.ptp(rates) < SAME_RATE * np.max(np.abs(rates)):
        raise CheckError(
            path,
            "one-rate",
            "all segments have the same rate, so bias and scale factor cannot be separated; add a "
            "still segment or a second rate",
        )


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
    found: list[Finding] = []
    if scale_sigma is None:
        return found
    beyond = excess(values, covariance, scale_sigma)
    for i in range(3):
        if not scale_sigma[i]:
            continue
        limit, value = MAX_SCALE_SIGMAS * float(scale_sigma[i]), float(values[i])
        if beyond[i] > 0.0:
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


def excess(values: FloatArray, covariance: FloatArray, scale_sigma: FloatArray) -> FloatArray:
    """Return by how much scale factor and installation errors (3,) exceed their limit, fraction.

    Positive where they do so with significance; scale_sigma: (3,) fraction, of the rig.
    """
    sigma = np.sqrt(np.diag(covariance)[:3])
    limit = MAX_SCALE_SIGMAS * scale_sigma
    return np.asarray(np.abs(values[:3]) - _SIGNIFICANT * sigma - limit)


def check_segment_lengths(
    path: str, turning: Sequence[Segment], *, earth_known: bool
) -> list[Finding]:
    """Return findings of turning segments of less than one turn."""
    found = []
    for segment in turning:
        turns = abs(segment.angle) / (2.0 * np.pi)
        if turns < 1.0:
            leak = "" if earth_known else ". Uncompensated Earth rate biases the result"
            where = format_span(segment.start, segment.end)
            text = f"{path}: segment {where} covers {turns:.2f} turns, less than one{leak}"
            found.append(Finding("segment-turns", text, "warning", where, turns, 1.0, "turns"))
    return found
