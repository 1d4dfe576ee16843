import numpy as np
import pytest

from rotcli.calibrate.plot import BINS, ResidualMeans


def test_a_trend_shows_against_time_and_a_period_of_a_turn_against_the_angle():
    interval = 0.01
    time = np.arange(0.0, 60.0, interval)
    angle = np.deg2rad(20.0) * time  # 3 turns and a third
    residual = np.column_stack([1e-4 * time, 2e-3 * np.sin(angle), np.full(len(time), 3e-3)])
    means = ResidualMeans(interval)
    for part in np.array_split(np.arange(len(time)), 3):
        means.add(time[part], angle[part], residual[part])
    at, value = means.against_time
    assert len(at) == 60
    assert np.allclose(np.polyfit(at, value[:, 0], 1), [1e-4, 0.0], atol=1e-9)
    middle, binned, count = means.against_angle
    assert len(middle) == BINS
    assert count.sum() == len(time)
    sinc = np.sinc(1.0 / BINS)  # mean of a sine over a bin of 15 deg
    assert np.allclose(binned[:, 1], 2e-3 * sinc * np.sin(middle), atol=1e-5)
    assert np.allclose(binned[:, 2], 3e-3)
    assert means.turned == pytest.approx(np.deg2rad(20.0) * 60.0, rel=1e-3)


def test_a_still_segment_has_no_bins():
    means = ResidualMeans(0.01)
    means.add(np.arange(0.0, 5.5, 0.01), np.zeros(550), np.ones((550, 3)))
    assert len(means.against_time[0]) == 5  # the last half second is omitted
    assert len(means.against_angle[0]) == 0
