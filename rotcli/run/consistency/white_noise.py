"""White noise of the gyros in a log, compared with the figures of the rig."""

from collections.abc import Sequence

import numpy as np

from rotcli.logs.record import TableLog
from rotcli.run.consistency.blocks import SegmentBlocks
from rotcli.run.findings import Finding
from rotcli.units import DEG_PER_ROOT_HOUR, FloatArray

_PARALLEL = 0.1  # cosine to the axis: gyros above it measure the rotation
_NOISE_FACTOR = 2.0  # of the rig's white noise: figures of a data sheet agree within it
# of the other gyros' ratio to the rig: another unit is 57 or 1000, a scale factor error 1.01
_CHANNEL_FACTOR = 4.0
_OUTLIER_SIGMAS = 6.0  # of a difference of block means; noise exceeds it with a chance of 2e-9


def estimate_white_noise(
    blocks: Sequence[SegmentBlocks], table: TableLog | None, u: FloatArray
) -> FloatArray:
    """Return the white noise (3,), rad/sqrt(s), from the differences of neighbouring blocks.

    table: of an uneven motion, whose rates (and what is proportional to them) are subtracted.
    Differences leave out drift and what the model does not explain; means of a quarter of a
    second what a sensor's own filter does to the noise from sample to sample.
    """
    differences = []
    for b in blocks:
        complete = b.gyro[b.counts == b.size]
        if table is not None:
            edges = np.clip(b.edges[: len(complete) + 1], table.time[0], table.time[-1])
            rate = np.diff(np.interp(edges, table.time, table.angle)) / (b.size * b.interval)
            slope = rate - rate.mean()
            complete = complete - np.outer(rate, (slope @ complete) / max(slope @ slope, 1e-300))
        differences.append(np.diff(complete, axis=0))
    length = blocks[0].size * blocks[0].interval
    white = np.sqrt(0.5 * length) * _rms(np.concatenate(differences))
    if table is not None:
        # Along the axis the differences also contain the encoder's noise; gyros are alike.
        white = np.where(np.abs(u) > _PARALLEL, np.minimum(white, white.min()), white)
    return np.asarray(white)


def _rms(differences: FloatArray) -> FloatArray:
    """Return the RMS (3,) of differences (n, 3) without those that a disturbance makes."""
    if not len(differences):
        return np.zeros(3)
    typical = 1.4826 * np.median(np.abs(differences), axis=0)
    usual = np.abs(differences) <= _OUTLIER_SIGMAS * np.where(typical > 0.0, typical, np.inf)
    squares = np.where(usual, differences, 0.0) ** 2
    return np.asarray(np.sqrt(squares.sum(axis=0) / np.maximum(usual.sum(axis=0), 1)))


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
