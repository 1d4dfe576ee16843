"""Check that the gyros follow the table inside every segment: no spikes, no missing rotation."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rotcli.run.consistency.blocks import SegmentBlocks
from rotcli.run.findings import Finding
from rotcli.units import DEG, FloatArray, format_span, show_time

# sigma of a block mean: 1e5 blocks of three gyros exceed it with a chance of 1e-3 (6.0 sigma),
# and a half more for the estimate of sigma from the scatter of the blocks.
_SPIKE_SIGMAS = 9.0
_RIPPLE = 2e-3  # of the table rate: a table's rate ripple and the eccentricity of its encoder
# rad/s over a block: less moves the mean of a minute by less than 0.3 deg/h
_MIN_SPIKE = 0.02 * DEG
_FOLLOWS = 0.2  # of the table rate: blocks that differ by more do not follow the table
_MIN_LOST = 0.5  # s in which the gyros do not follow the table: more than a spike
CLIPPED_SHARE = 0.01  # of the samples: a segment with more is rejected


def check_steadiness(path: str, segments: Sequence[SegmentBlocks]) -> tuple[Finding, ...]:
    """Return the findings of spikes, faulted rows and lost rotation in the segments."""
    found: list[Finding] = []
    for blocks in segments:
        where = format_span(blocks.segment.start, blocks.segment.end)
        found += blocks.scan.findings(path, where)
        found += _spikes(path, where, blocks)
    return tuple(found)


def clipped(segments: Sequence[SegmentBlocks]) -> list[bool]:
    """Return for each segment whether too many of its samples are clipped to be used."""
    return [b.scan.clipped.sum() > CLIPPED_SHARE * b.scan.rows for b in segments]


def check_clipping(path: str, reduced: Sequence[SegmentBlocks]) -> list[Finding]:
    """Return the findings of segments that are rejected because they are clipped."""
    found = []
    for blocks, bad in zip(reduced, clipped(reduced), strict=True):
        if bad:
            share = float(blocks.scan.clipped.max()) / blocks.scan.rows
            channel = f"gyro_{'xyz'[int(np.argmax(blocks.scan.clipped))]}"
            where = format_span(blocks.segment.start, blocks.segment.end)
            text = (
                f"{path}: segment {where} is rejected: {share:.2g} of the samples of "
                f"{channel} are clipped at gyro_range; use a lower rate"
            )
            found.append(Finding("segment-clipped", text, "warning", where, share, CLIPPED_SHARE))
    return found


def block_deviations(blocks: SegmentBlocks) -> tuple[FloatArray, FloatArray] | None:
    """Return the deviations (k, 3) of the blocks of a segment from their neighbours, with limits.

    rad/s; limits (3,). None where the segment has too few blocks. The last block is left out where
    it is shorter than the others.
    """
    deviation = blocks.deviations
    if deviation is None:
        return None
    sigma = 1.48 * np.median(np.abs(deviation), axis=0)
    least = _RIPPLE * abs(blocks.segment.rate) + _MIN_SPIKE
    return deviation, np.maximum(_SPIKE_SIGMAS * sigma, least)


def _spikes(path: str, where: str, blocks: SegmentBlocks) -> list[Finding]:
    """Return the finding of the largest spike of a segment, and of rotation that is lost."""
    found_deviations = block_deviations(blocks)
    if found_deviations is None:
        return []
    deviation, limit = found_deviations
    rate, k = blocks.segment.rate, len(deviation)
    gyro = blocks.gyro[:k]
    ratio = np.abs(deviation) / limit
    found = []
    main = int(np.argmax(np.abs(np.median(gyro, axis=0))))
    slower = -deviation[:, main] * np.sign(np.median(gyro[:, main]))
    lost = slower > max(_FOLLOWS * abs(rate), float(limit[main])) if rate else np.zeros(k, bool)
    run = _longest_run(lost)
    seconds = (run[1] - run[0]) * blocks.size * blocks.interval
    if seconds >= _MIN_LOST and not blocks.scan.zeros:  # else the zeros are the cause
        at = format_span(float(blocks.edges[run[0]]), float(blocks.edges[run[1]]))
        text = (
            f"{path}: segment {where}: the gyros do not follow the table from {at}; check the "
            "clocks of the logs ([table] time_offset) and the readings"
        )
        found.append(Finding("rotation-not-followed", text, "warning", where, seconds, _MIN_LOST))
    elif ratio.max() > 1.0:
        row, i = divmod(int(np.argmax(ratio)), 3)
        when = show_time(float(blocks.edges[row]))
        size = float(np.abs(deviation[row, i]))
        text = (
            f"{path}: segment {where} was disturbed near {when} s (gyro_{'xyz'[i]} deviates by "
            f"{size / DEG:.3g} deg/s over {blocks.size * blocks.interval:.3g} s); exclude this part"
        )
        channel = f"gyro_{'xyz'[i]}"
        bound = float(limit[i]) / DEG
        found.append(
            Finding("segment-disturbed", text, "warning", channel, size / DEG, bound, "deg/s")
        )
    return found


def _longest_run(flags: NDArray[np.bool_]) -> tuple[int, int]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8)))
    if not len(edges):
        return 0, 0
    runs = edges.reshape(-1, 2)
    first, last = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))]
    return int(first), int(last)
