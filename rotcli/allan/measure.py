"""Measure the noise of one axis of a still record: readings in, curve and summary out.

One buffer has the readings of all segments; they are integrated there, in place. It is all the
memory that an axis needs: two days of one axis are 140 MB.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rotcli.allan.deviation import Factors, deviation, integrate
from rotcli.allan.fit.gauss_markov import block_averages
from rotcli.allan.fit.summary import Summary, summarize
from rotcli.allan.pooled import pooled_variance
from rotcli.allan.survey.clipping import Clipping, find_clipping
from rotcli.allan.survey.drift import BLOCKS, Drift
from rotcli.allan.survey.spectrum import Spectrum, survey
from rotcli.dataclass import dataclass
from rotcli.errors import LogError
from rotcli.logs.record import CHUNK_SAMPLES, ImuSource
from rotcli.run.still.record import StillRecord
from rotcli.units import FloatArray

Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Measured:
    """Measures of an axis that remain when its readings are gone.

    curve (k,): deviations at the wanted cluster times. averages (b,): of blocks of `block` s of
    the longest segment. mean: of the record.
    """

    curve: FloatArray
    summary: Summary
    averages: FloatArray
    block: float
    mean: float
    spectrum: Spectrum | None
    clipping: Clipping | None


@dataclass(frozen=True, eq=False)
class Plan:
    """Cluster lengths of the curve (k,) and of the fit (j,), and the estimator of the curve."""

    factors: Factors
    coarse: Factors
    estimator: str


def measure_axis(
    log: ImuSource, record: StillRecord, name: str, plan: Plan, drifts: Sequence[Drift] = ()
) -> Measured:
    """Measure one axis of a record, without the given drifts.

    Raises LogError if the sensor never changes or the estimator cannot be computed.
    """
    buffer = np.empty(sum(record.lengths) + len(record.lengths))
    phases = _split(buffer, record.lengths)
    low, high = np.inf, -np.inf
    for phase, segment in zip(phases, record.segments, strict=True):
        log.fill(phase[1:], name, segment)
        _interpolate(phase[1:], record.spikes.get(name), segment)
        low, high = min(low, phase[1:].min()), max(high, phase[1:].max())
        for drift in drifts:
            _subtract(log, phase[1:], segment, drift)
    if high == low:
        raise LogError(log.path, "the readings are constant; exclude this axis", column=name)
    try:
        return _measure(phases, plan, log.interval, record.gap_lengths(name))
    except ValueError as fault:
        raise LogError(
            log.path, f"{fault}; choose other averaging times", code="averaging-times"
        ) from fault


def _split(buffer: FloatArray, lengths: Sequence[int]) -> list[FloatArray]:
    """Return the phases (n + 1,) of the segments as parts of one buffer."""
    ends = np.cumsum([n + 1 for n in lengths])
    return np.split(buffer, ends[:-1])


def _interpolate(values: FloatArray, samples: Index | None, segment: slice) -> None:
    """Replace the samples (k,) of the log that lie in a segment by straight lines, in place."""
    if samples is None:
        return
    places = samples[(samples >= segment.start) & (samples < segment.stop)] - segment.start
    if not len(places):
        return
    around = np.setdiff1d(np.concatenate([places - 1, places + 1]), places)
    around = around[(around >= 0) & (around < len(values))]
    values[places] = np.interp(places, around, values[around])


def _subtract(log: ImuSource, values: FloatArray, segment: slice, drift: Drift) -> None:
    """Subtract a drift from the readings of a segment, in place."""
    for first in range(segment.start, segment.stop, CHUNK_SAMPLES):
        part = slice(first, min(first + CHUNK_SAMPLES, segment.stop))
        temperature = None
        if drift.kind == "temperature":
            temperature = np.empty(part.stop - part.start)
            log.fill(temperature, "temperature", part)
        inside = slice(part.start - segment.start, part.stop - segment.start)
        values[inside] -= drift.values(log.times(part), temperature)


def _measure(phases: list[FloatArray], plan: Plan, interval: float, gaps: Index) -> Measured:
    """Measure readings, each in phase[1:] of its segment; they are integrated there."""
    longest = max(phases, key=len)
    spectrum = survey([phase[1:] for phase in phases], interval)
    clipping = find_clipping(longest[1:])
    lengths = [len(phase) - 1 for phase in phases]
    means = [integrate(phase, interval) for phase in phases]
    if plan.estimator == "oadev":  # one pass for the curve's cluster times and the fit's
        every = np.union1d(plan.factors, plan.coarse)
        variances = pooled_variance(phases, every, interval)
        known = variances[np.searchsorted(every, plan.coarse)]
        curve = np.sqrt(variances[np.searchsorted(every, plan.factors)])
    else:
        known, curve = None, deviation(longest, plan.factors, interval, plan.estimator)
    averages, block = block_averages(longest, interval)
    return Measured(
        curve=curve,
        summary=summarize(phases, plan.coarse, interval, known, spectrum, gaps),
        averages=averages,
        block=block,
        mean=float(np.average(means, weights=lengths)),
        spectrum=spectrum,
        clipping=clipping,
    )


def drift_blocks(
    log: ImuSource, record: StillRecord, measured: Measured, *, has_temperature: bool
) -> tuple[FloatArray, float, float, FloatArray | None] | None:
    """Return block means (BLOCKS,), their start and length (s), and mean temperatures or None.

    None for a record with less than two averages a block.
    """
    count = len(measured.averages) // BLOCKS
    if count < 2:
        return None
    means = measured.averages[: BLOCKS * count].reshape(BLOCKS, count).mean(axis=1)
    longest = max(record.segments, key=lambda s: s.stop - s.start)
    start = float(log.times(slice(longest.start, longest.start + 1))[0])
    temperature = None
    if has_temperature:
        size = round(count * measured.block / log.interval)
        temperature, values = np.empty(BLOCKS), np.empty(size)
        for k in range(BLOCKS):
            first = longest.start + k * size
            log.fill(values, "temperature", slice(first, first + size))
            temperature[k] = values.mean()
    return means, start, count * measured.block, temperature
