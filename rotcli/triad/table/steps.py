"""Steps of a table log: intervals of constant acceleration, and polynomials of angle over them.

The log is cut where the table's acceleration jumps, found from differences of the encoder over a
baseline that is long enough for its noise. Angles, rates and accelerations of a block come from a
cubic fitted to the encoder within it: the noise and the resolution of the encoder average out,
which a spline through its samples does not do.
"""

import numpy as np
from numpy.typing import NDArray

from rotcli.dataclass import dataclass
from rotcli.units import DEG, FloatArray

IntArray = NDArray[np.int64]

ACCELERATION_JUMP = 1.0 * DEG  # rad/s^2: a twentieth of the usual ramp
_NOISE_MARGIN = 6.0  # sigmas of the differences below the jump
MAX_BASELINE = 0.3  # s; a longer baseline smears the ends of ramps
STILL_RATE = 0.02 * DEG  # rad/s; 100 times Earth rate moves a block's angle by 0.2 deg at most
REST_ANGLE = 2e-6 * DEG  # rad, digits of a log: a table at rest deviates by no more
RAMP_ACCELERATION = 0.5 * DEG  # rad/s^2, between a constant rate and a ramp
_CALM_SHARE, _CALM_SIGMAS = 0.6827, 1.0  # third differences below one sigma; kinks are rarer
_CHUNK = 100_000  # table samples searched at once
_NOISE_SAMPLES = 500_000  # of a long log that show the encoder's noise
_GAP = 2.5  # spacings between samples of the table log: records are missing
MIN_STEP = 0.1  # s; shorter steps have no block


@dataclass(frozen=True, eq=False)
class Steps:
    """Intervals [start, end] (p,), s, of constant table acceleration; still (p,)."""

    start: FloatArray
    end: FloatArray
    still: NDArray[np.bool_]
    peak_rate: FloatArray


def encoder_noise(angles: FloatArray, time: FloatArray | None = None) -> float:
    """Return the noise (rad) of one encoder sample (m, K), of the noisiest axis.

    time: (m,) s; differences across gaps of it are excluded. Third differences vanish at constant
    acceleration; their scatter while an axis moves is the noise, or the rounding to the encoder's
    resolution. Samples at rest would show no rounding.
    """
    angles = angles[:_NOISE_SAMPLES]
    third = np.abs(np.diff(angles, n=3, axis=0))
    moved = np.abs(angles[3:] - angles[:-3])
    if time is not None:
        span = time[3 : len(angles)] - time[: len(angles) - 3]
        even = span < _GAP * np.quantile(span, 0.5)
        third, moved = third[even], moved[even]
    found = 0.0
    for k in range(angles.shape[1]):
        moving = moved[:, k] > 0.5 * float(moved[:, k].max())
        if moved[:, k].max() > 0.0:
            scatter = float(np.quantile(third[moving, k], _CALM_SHARE))
            found = max(found, scatter / (_CALM_SIGMAS * np.sqrt(20.0)))
    return found


def find_steps(time: FloatArray, angles: FloatArray) -> Steps:
    """Return the steps of a table log: time (m,), s, evenly spaced; angles (m, K), rad."""
    spacing = float(np.quantile(np.diff(time), 0.5))
    noise = encoder_noise(angles, time)
    # The difference of two accelerations over baselines of L samples has the noise
    # sqrt(20) sigma / (L spacing)^2 when L = 1, and less than that for larger L.
    least = np.sqrt(_NOISE_MARGIN * np.sqrt(20.0) * noise / ACCELERATION_JUMP)
    L = int(np.clip(np.ceil(least / spacing), 1, max(1, int(MAX_BASELINE / spacing))))
    marked = np.zeros(len(time), dtype=bool)
    gaps = np.flatnonzero(np.diff(time) > _GAP * spacing)
    marked[gaps] = marked[gaps + 1] = True
    margin = 3 * L + 2 * round(MIN_STEP / spacing) + 2
    for begin in range(0, len(time), _CHUNK):
        # Chunks overlap, so that every difference is formed in one of them.
        part = slice(max(0, begin - margin), min(len(time), begin + _CHUNK + margin))
        marked[part] |= _jumps(angles[part], L, spacing)
        marked[part] |= _starts_and_stops(angles[part], spacing, noise)
    edges = np.flatnonzero(np.diff(np.concatenate([[1], marked.astype(np.int8), [1]])))
    first, last = edges[::2], edges[1::2] - 1
    long = (time[last] - time[first]) >= MIN_STEP
    first, last = first[long], last[long]
    peak = np.empty(len(first))
    for k, (a, b) in enumerate(zip(first, last, strict=True)):
        ends = max(1, min(b - a, round(MIN_STEP / spacing)))
        rates = np.abs(angles[[a + ends, b]] - angles[[a, b - ends]]) / (ends * spacing)
        mean = np.abs(angles[b] - angles[a]) / (time[b] - time[a])
        peak[k] = max(float(rates.max()), float(mean.max()))
    allowed = STILL_RATE + _NOISE_MARGIN * noise / MIN_STEP
    moved = np.array(
        [np.ptp(angles[a : b + 1], axis=0).max() for a, b in zip(first, last, strict=True)]
    )
    drifted = moved > STILL_RATE * (time[last] - time[first]) + _NOISE_MARGIN * noise
    still = (peak < allowed) & ~drifted
    for k in np.flatnonzero(still).tolist():
        first[k], last[k] = _without_soft_ends(angles, int(first[k]), int(last[k]), noise)
    return Steps(time[first], time[last], still, peak)


def _without_soft_ends(angles: FloatArray, first: int, last: int, noise: float) -> tuple[int, int]:
    """Return the first and last sample at rest of a still step.

    A motion that begins or ends softly moves the table within the step: by less than STILL_RATE,
    but a mean over the block then contains an angle that the model does not.
    """
    part = angles[first : last + 1]
    deviation = np.abs(part - np.quantile(part, 0.5, axis=0))
    rest = np.flatnonzero(deviation.max(axis=1) <= _NOISE_MARGIN * noise + REST_ANGLE)
    if 2 * len(rest) <= last + 1 - first:  # a table that never rests: nothing to cut
        return first, last
    return first + int(rest[0]), first + int(rest[-1])


def _jumps(angles: FloatArray, L: int, spacing: float) -> NDArray[np.bool_]:
    """Return which samples (m,) lie where the acceleration jumps; baseline of L samples."""
    marked = np.zeros(len(angles), dtype=bool)
    if len(angles) <= 3 * L:
        return marked
    third = angles[3 * L :] - 3 * angles[2 * L : -L] + 3 * angles[L : -2 * L] - angles[: -3 * L]
    jump = np.abs(third).max(axis=1) / (L * spacing) ** 2
    hit = np.flatnonzero(jump > ACCELERATION_JUMP)
    for offset in range(L, 2 * L + 1):  # the jump lies between the two inner samples
        marked[hit + offset] = True
    return marked


def _starts_and_stops(angles: FloatArray, spacing: float, noise: float) -> NDArray[np.bool_]:
    """Return which samples (m,) lie between rest and motion, where a soft ramp has no jump."""
    half = max(1, round(0.5 * MIN_STEP / spacing))
    marked = np.zeros(len(angles), dtype=bool)
    if len(angles) <= 2 * half:
        return marked
    moved = np.abs(angles[2 * half :] - angles[: -2 * half]).max(axis=1)
    moving = moved > STILL_RATE * 2 * half * spacing + _NOISE_MARGIN * noise
    edge = np.flatnonzero(np.diff(moving.astype(np.int8))) + half
    for offset in range(-half, half + 2):
        marked[np.clip(edge + offset, 0, len(marked) - 1)] = True
    return marked


def fit_cubics(
    time: FloatArray,
    angles: FloatArray,
    middle: FloatArray,
    half: FloatArray,
    low: IntArray,
    high: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Return cubics (4, K, m) of the angle in (t - middle) / half, and the misfit (m,), rad.

    Samples low to high of each block take part; the misfit is the largest deviation of one.

    middle, half, low, high: (m,), one per block; at least four samples in each.
    """
    counts = high - low
    owner = np.repeat(np.arange(len(low)), counts)
    index = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts) + low[owner]
    u = (time[index] - middle[owner]) / half[owner]
    starts = np.cumsum(counts) - counts
    powers = [np.ones_like(u), u, u * u, u**3]
    moments = [np.add.reduceat(u**k, starts) for k in range(7)]
    A = np.empty((len(low), 4, 4))
    for i in range(4):
        for j in range(4):
            A[:, i, j] = moments[i + j]
    # Angles relative to the first sample of each block keep all digits of long rotations.
    zero = angles[low]
    local = angles[index] - zero[owner]
    right = np.stack([np.add.reduceat(local * q[:, None], starts) for q in powers], axis=1)
    found = np.linalg.solve(A, right)
    fitted = sum(q[:, None] * found[owner, k] for k, q in enumerate(powers))
    misfit = np.maximum.reduceat(np.abs(local - fitted).max(axis=1), starts)
    found[:, 0] += zero
    return np.ascontiguousarray(found.transpose(1, 2, 0)), misfit
