"""Compare a calibration with what the rig allows: size of the errors, noise, rates, segments."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rotcli.calibrate.reduction import SegmentBlocks
from rotcli.logs.record import Segment, TableLog
from rotcli.run.findings import CheckError, Finding
from rotcli.run.recording import SAME_RATE
from rotcli.units import DEG_PER_ROOT_HOUR, PPM, show_span

FloatArray = NDArray[np.float64]

_MAX_SCALE_SIGMAS = 10.0  # times scale_sigma of the rig: no device of the type has such an error
_SIGNIFICANT = 4.0  # sigma by which the value exceeds the limit
_PARALLEL = 0.1  # cosine to the axis: gyros above it measure the rotation
_NOISE_FACTOR = 2.0  # of the rig's white noise: figures of a data sheet agree within it
# of the other gyros' ratio to the rig: another unit is 57 or 1000, a scale factor error 1.01
_CHANNEL_FACTOR = 4.0


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


def estimate_white_noise(
    blocks: Sequence[SegmentBlocks], table: TableLog | None, u: FloatArray
) -> FloatArray:
    """Return the white noise (3,), rad/sqrt(s), from the differences of neighbouring blocks.

    table: of an uneven motion, whose rates (and what is proportional to them) are subtracted.
    Differences leave out drift and what the model does not explain; means of a quarter of a
    second what a sensor's own filter does to the noise from sample to sample.
    """
    squares, pairs = np.zeros(3), 0
    for b in blocks:
        complete = b.gyro[b.counts == b.size]
        if table is not None:
            edges = np.clip(b.edges[: len(complete) + 1], table.time[0], table.time[-1])
            rate = np.diff(np.interp(edges, table.time, table.angle)) / (b.size * b.interval)
            slope = rate - rate.mean()
            complete = complete - np.outer(rate, (slope @ complete) / max(slope @ slope, 1e-300))
        squares += (np.diff(complete, axis=0) ** 2).sum(axis=0)
        pairs += max(0, len(complete) - 1)
    length = blocks[0].size * blocks[0].interval
    white = np.sqrt(0.5 * length * squares / max(1, pairs))
    if table is not None:
        # Along the axis the differences also contain the encoder's noise; gyros are alike.
        white = np.where(np.abs(u) > _PARALLEL, np.minimum(white, white.min()), white)
    return np.asarray(white)


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
