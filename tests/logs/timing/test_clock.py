import numpy as np
import pytest

from rotcli.logs.timing.clock import (
    StreamingClockFit,
    _first_interval,
    clock_from_stamps,
    fit_sample_clock,
    is_even,
)
from rotcli.logs.timing.counting import count_clock, count_records
from rotcli.logs.timing.line import fit_line
from rotcli.logs.timing.record_slots import RecordSlots
from rotcli.logs.timing.resample import resample


def stamps(n, interval, *, jitter=0.0, quantum=0.0, gaps=(), seed=0, start=1000.0):
    """Stamps of an even clock: jitter in samples, gaps as (before which record, how many)."""
    index = np.arange(n)
    for before, lost in gaps:
        index[before:] += lost
    time = start + interval * (index + np.random.default_rng(seed).uniform(-jitter, jitter, n))
    return (np.floor(time / quantum) * quantum if quantum else time), index


GAPS = {
    "none": (),
    "one sample": ((4000, 1),),
    "early and late": ((3, 1), (7990, 2)),
    "many": tuple((100 * i, 1 + i % 3) for i in range(1, 79)),
    "thousands": ((5000, 3000), (5003, 1), (6000, 700)),
}


@pytest.mark.parametrize("gaps", GAPS)
@pytest.mark.parametrize(
    ("interval", "jitter", "quantum"),
    [
        (0.01, 0.0, 0.0),
        (0.01, 0.1, 0.0),
        (0.01, 0.4, 0.0),
        (1 / 150, 0.0, 0.001),
        (1 / 128, 0.2, 0.001),
        (0.0025, 0.1, 0.001),
    ],
)
def test_even_clock_is_found_behind_gaps_jitter_and_complete_milliseconds(
    interval, jitter, quantum, gaps
):
    for seed in range(4):
        time, index = stamps(
            8000, interval, jitter=jitter, quantum=quantum, gaps=GAPS[gaps], seed=seed
        )
        line = fit_sample_clock(time)
        assert line is not None
        np.testing.assert_array_equal(line.slots, index)
        # Half a quantum late on average; the line through 8000 uniform stamps of half width w
        # is good to 2 w sqrt(3) / sqrt(3 * 8000) = 0.02 w at its ends; six sigma of that.
        width = jitter * interval + 0.5 * quantum
        error = line.times()[line.slots] - (1000 + interval * index - 0.5 * quantum)
        # Without jitter the stamps fall on few phases of the quantum, whose mean is their own.
        few = 0.5 * quantum if jitter == 0.0 else 0.0
        assert np.abs(error).max() < 0.14 * width + few + 1e-9


def test_jitter_of_nearly_half_a_sample_is_borne():
    for seed in range(5):
        time, index = stamps(30000, 0.01, jitter=0.45, gaps=((9000, 1), (20000, 40)), seed=seed)
        line = fit_sample_clock(time)
        assert line is not None
        np.testing.assert_array_equal(line.slots, index)
        assert line.max_deviation == pytest.approx(0.0045, rel=0.02)
        assert line.rms == pytest.approx(0.0045 / np.sqrt(3), rel=0.02)  # uniform


@pytest.mark.parametrize("n", [300_000, pytest.param(3_000_000, marks=pytest.mark.campaign)])
def test_index_does_not_drift_over_many_records(n):
    time, index = stamps(n, 0.01, jitter=0.3, gaps=((5, 1), (2 * n // 3, 3000)))
    line = fit_sample_clock(time)
    assert line is not None
    np.testing.assert_array_equal(line.slots, index)


def test_exact_stamps_come_back_exactly():
    time = np.arange(30000) * 0.01
    line = fit_sample_clock(time)
    assert line is not None
    np.testing.assert_array_equal(line.times(), time)


@pytest.mark.parametrize("gap", [0.0, 0.05])
def test_clock_that_drifts_off_the_line_is_not_called_even(gap):
    x = np.linspace(0, 1, 20000)
    for spacing in (1 + 0.1 * (x > 0.5), 1 + 0.05 * np.sin(9 * x), 1 + 0.02 * x):
        time = np.cumsum(0.01 * spacing)
        time[10000:] += gap
        assert fit_sample_clock(time) is None


def test_literal_stamps_are_resampled_to_third_order():
    # Four-point interpolation errs by (9/16) h^4 f''''/24, h the widest spacing: halving h
    # divides it by 16; of sin(3 t) at 12.5 ms that is 81 * 5.7e-10.
    worst = []
    for h in (0.01, 0.005):
        n = round(10 / h)
        time = h * (np.arange(n) + 0.25 * np.sin(np.arange(n) / 3))
        values = np.stack([np.sin(3 * time), np.cos(3 * time)])
        grid, result, missing = resample(time, values, clock_from_stamps(time), averages=False)
        assert missing is None
        worst.append(np.abs(result - np.stack([np.sin(3 * grid), np.cos(3 * grid)])).max())
    assert worst[0] < 8e-8
    assert 10 < worst[0] / worst[1] < 24


def test_literal_averages_keep_their_integral():
    rng = np.random.default_rng(1)
    time = np.cumsum(0.01 * (1 + 0.3 * np.sin(np.arange(1000) / 50) + rng.uniform(-0.1, 0.1, 1000)))
    step = np.diff(time, prepend=time[0] - 0.01)
    values = ((np.sin(time) - np.sin(time - step)) / step)[None]  # means of cos
    line = clock_from_stamps(time)
    grid, result, missing = resample(time, values, line, averages=True)
    assert missing is None
    dt = grid[1] - grid[0]
    # The first mean reaches back an interval no one logged; the rest are exact to h^4.
    true = (np.sin(grid) - np.sin(grid - dt)) / dt
    np.testing.assert_allclose(result[0, 2:], true[2:], atol=1e-6)


def test_gap_in_literal_stamps_is_bridged_by_a_straight_line():
    time = np.delete(np.arange(100) * 0.01, [50, 51, 52])
    for averages in (False, True):
        grid, result, missing = resample(
            time, time[None], clock_from_stamps(time), averages=averages
        )
        assert missing is not None
        assert np.flatnonzero(missing).tolist() == [50, 51, 52]
        np.testing.assert_allclose(result[0], grid, atol=1e-2 if averages else 1e-12)


def test_stamps_that_are_taken_for_even_deviate_by_no_more_from_their_line(monkeypatch):
    monkeypatch.setattr("rotcli.logs.timing.clock.CHUNK_SAMPLES", 100)
    n, interval, jitter = 1000, 0.01, 0.1
    grid = 5.0 + interval * np.arange(n)
    x = np.linspace(-1.0, 1.0, n)
    worst = np.sign(1.0 - 3.0 * x)  # the weights of the line at the first stamp
    worst[[0, -1]] = 0.0
    rng = np.random.default_rng(2)
    for shape in (np.zeros(n), worst, -worst, rng.uniform(-1.0, 1.0, n) * (abs(x) < 1.0)):
        for size in (0.3, 0.333, 0.334, 1.0):
            time = grid + size * jitter * interval * shape
            line = fit_sample_clock(time)
            assert is_even(time, jitter) == (size < 1.0 / 3.0 or not shape.any())
            if is_even(time, jitter):
                assert line.max_deviation < jitter * line.interval
    assert not is_even(np.delete(grid, 500), jitter)
    assert not is_even(grid[:1], jitter)


@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_pieces_of_a_log_have_the_clock_of_the_complete_log(jitter):
    gaps = ((300, 2), (1000, 5), (1700, 1), (2600, 3))  # the second between two pieces
    time, index = stamps(3000, 0.01, jitter=jitter, gaps=gaps, seed=3, start=50.0)
    complete = fit_sample_clock(time)
    fit = StreamingClockFit()
    added = [gap for piece in np.split(time, [1000, 2000]) for gap in fit.add(piece)]
    assert added == fit.gaps == [(before - 1, lost) for before, lost in gaps]
    line, literal = fit.line()
    assert not literal
    assert line.slots.tolist() == [0, *index[[999, 1999, 2999]]]
    assert line.start == pytest.approx(complete.start, abs=1e-9)
    assert line.interval == pytest.approx(complete.interval, rel=1e-9)
    assert line.rms == pytest.approx(complete.rms, rel=1e-6, abs=1e-9)
    assert complete.max_deviation <= line.max_deviation + 1e-12
    slots = RecordSlots(fit.gaps)
    np.testing.assert_array_equal(slots.of(900, 1200), index[900:2100])
    for slot in (0, 299, 300, 301, 302, 1005, 1010, 2999):
        before = slots.record_before(slot)
        assert index[before] <= slot
        assert before == 0 or np.count_nonzero(index <= slot) - before <= 7


def test_a_clock_that_was_set_does_not_change_the_interval_of_counted_records():
    time = 10.0 + 0.02 * np.arange(500)
    single = time.copy()
    single[200] += 30.0  # one wrong stamp
    back = time.copy()
    back[300:] -= 4.0  # a clock that starts again
    ahead = time.copy()
    ahead[100:] += 3600.0  # a clock that is set
    little = time.copy()
    little[300:] -= 0.05  # starts again by two samples and a half
    swapped = time.copy()
    for k in (3, 100, 250, 480):
        swapped[[k, k + 1]] = swapped[[k + 1, k]]
    late = np.delete(time, 400)
    late = np.insert(late, 405, time[400])  # a record that comes five records late
    both = swapped.copy()
    both[200] -= 7.0
    for stamped in (time, single, back, ahead, little, swapped, late, both):
        found = count_records(stamped)
        assert found.interval == pytest.approx(0.02, rel=1e-6)
        assert found.start == 10.0
        assert found.counted
    assert count_records(back, 25.0).interval == 0.04


def test_blocks_that_leave_the_line_are_no_counted_clock():
    time = 0.01 * np.arange(2000)
    burst = time + 0.02 * (np.arange(2000) % 7 == 0)  # late by two samples, but back each time
    assert count_clock(burst).interval == pytest.approx(0.01, rel=1e-4)
    lost = burst + 0.01 * 3 * (np.arange(2000) >= 1000)  # three samples lost for good
    assert count_clock(lost) is None


def test_a_line_of_least_squares_is_that_of_numpy():
    x = 0.1 * np.arange(50) + 0.01 * np.sin(np.arange(50.0))
    line = fit_line(7.0, x, None, 0.0, 0.1)
    slope, offset = np.polyfit(np.arange(50), x, 1)
    assert line.fitted == pytest.approx((7.0 + offset, slope), rel=1e-12)
    rest = x - offset - slope * np.arange(50)
    assert line.rms == pytest.approx(np.sqrt(np.mean(rest**2)), rel=1e-9)
    assert line.max_deviation == pytest.approx(np.abs(rest).max(), rel=1e-9)
    odd = np.arange(50) * 2 + 3
    again = fit_line(7.0, x, odd, 0.0, 0.05)
    assert again.slots.tolist() == list(range(0, 100, 2))
    assert again.fitted == pytest.approx((7.0 + offset, 0.5 * slope), rel=1e-12)


def test_the_first_interval_is_that_of_the_longest_spans_without_a_gap():
    time, _ = stamps(8000, 0.01, jitter=0.2, seed=5)
    interval, lag = _first_interval(time - time[0])
    assert lag == 1024
    # The median of 7000 spans with a triangular jitter of 4 ms.
    assert interval == pytest.approx(0.01, rel=1e-5)
    gaps = tuple((100 * i, 1) for i in range(1, 79))
    time, _ = stamps(8000, 0.01, jitter=0.2, gaps=gaps, seed=5)
    interval, lag = _first_interval(time - time[0])
    assert lag in {32, 64}  # most spans of 128 records contain a gap
    assert abs(interval - 0.01) * lag < 0.5 * 0.01  # known to half a sample over the lag
