"""Tests of a calibration next to chi-squared, as figures that the result keeps.

Each has a value, a limit and a verdict, whether the log passes or not: sines of the table angle in
the residuals, steadiness inside the segments, clipped readings, errors that no device has.
"""

from collections.abc import Sequence

import numpy as np

from rotcli.calibrate.plausibility import MAX_SCALE_SIGMAS, excess
from rotcli.dataclass import dataclass
from rotcli.run.consistency.blocks import SegmentBlocks
from rotcli.run.consistency.harmonics import Harmonics
from rotcli.run.consistency.steadiness import CLIPPED_SHARE, block_deviations
from rotcli.units import FloatArray, format_span


@dataclass(frozen=True)
class LimitTest:
    """One test: its figure, the limit, whether it is exceeded, and where the figure is largest.

    dof: degrees of freedom, where the figure is chi-squared.
    """

    value: float
    limit: float
    exceeded: bool
    where: str = ""
    dof: int | None = None


def harmonics_test(harmonics: Harmonics | None) -> LimitTest | None:
    """Return the test of sines once and twice per turn; None where the log does not show them."""
    if harmonics is None:
        return None
    limit = harmonics.limit
    return LimitTest(harmonics.chi2, limit, harmonics.chi2 > limit, dof=harmonics.dof)


def steadiness_test(segments: Sequence[SegmentBlocks]) -> LimitTest | None:
    """Return the largest deviation of a block from its neighbours, as a share of its limit."""
    largest: LimitTest | None = None
    for blocks in segments:
        found = block_deviations(blocks)
        if found is None:
            continue
        ratio = np.abs(found[0]) / found[1]
        if largest is None or ratio.max() > largest.value:
            row, i = divmod(int(np.argmax(ratio)), 3)
            where = f"gyro_{'xyz'[i]} near {blocks.edges[row]:.6g} s"
            largest = LimitTest(float(ratio.max()), 1.0, bool(ratio.max() > 1.0), where)
    return largest


def clipping_test(segments: Sequence[SegmentBlocks]) -> LimitTest | None:
    """Return the largest share of samples at gyro_range; None where the rig has no range."""
    shares = [
        (float(b.scan.clipped.sum()) / b.scan.rows, format_span(b.segment.start, b.segment.end))
        for b in segments
        if b.scan.gyro_range is not None and b.scan.rows
    ]
    if not shares:
        return None
    share, where = max(shares)
    return LimitTest(share, CLIPPED_SHARE, share > CLIPPED_SHARE, where if share else "")


def plausibility_test(
    values: FloatArray, covariance: FloatArray, names: Sequence[str], scale_sigma: FloatArray | None
) -> LimitTest | None:
    """Return the largest of scale factor and installation errors over scale_sigma of the rig."""
    if scale_sigma is None or not np.all(scale_sigma):
        return None
    ratio = np.abs(values[:3]) / scale_sigma
    k = int(np.argmax(ratio))
    exceeded = bool(np.any(excess(values, covariance, scale_sigma) > 0.0))
    return LimitTest(float(ratio[k]), MAX_SCALE_SIGMAS, exceeded, names[k])


def limit_tests(
    segments: Sequence[SegmentBlocks],
    harmonics: Harmonics | None,
    values: FloatArray,
    covariance: FloatArray,
    names: Sequence[str],
    scale_sigma: FloatArray | None,
) -> dict[str, LimitTest | None]:
    """Return the tests by name: harmonics, steadiness, clipping, scale; None: not tested."""
    return {
        "harmonics": harmonics_test(harmonics),
        "steadiness": steadiness_test(segments),
        "clipping": clipping_test(segments),
        "scale": plausibility_test(values, covariance, names, scale_sigma),
    }
