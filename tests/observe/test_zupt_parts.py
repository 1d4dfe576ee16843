"""The filter on logs of any length: part by part it finds what it finds at once."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs import record, stream
from rotcli.logs.imu import write_columns
from rotcli.logs.stream import StreamedImuLog, open_imu
from rotcli.models.sensors import TriadErrors
from rotcli.observe.zupt import (
    Options,
    ZuptHistory,
    estimate_parts,
    filter_log,
    passes,
    prepare_zupt,
)
from rotcli.observe.zupt import prepare as stage
from rotcli.observe.zupt.filter import ZuptFilter, run
from rotcli.observe.zupt.model import InitialSigma, build_update_model
from rotcli.units import DEG, DEG_PER_HOUR
from tests.observe.zupt_runs import simulated

from .zupt_truth import DT, perfect, sensors, settings, staircase

ARM = (0.05, -0.03, 0.08)
CASES = {
    "turning": ("y30", {}),
    "still": ("still", {}),
    "scale": ("z30", {"initial": InitialSigma(scale=2e-3)}),
    "lever arm": ("x30", {"lever_arm": ARM, "estimate_lever_arm": True}),
    "free azimuth": ("y30", {"slave_azimuth": False, "initial": InitialSigma(scale=2e-3)}),
    "averages, odd updates": ("y0", {"samples_are_means": True, "samples": 7}),
}


def same(values, sigma, expected_values, expected_sigma):
    """Compare estimates (n, m) as closely as they are determined.

    A sine or a product may be rounded differently elsewhere in an array. Each update adds velocity
    increments of g 0.1 s = 1 m/s, rounded to 1e-16, to velocities whose sigma is 1e-4 and less:
    1e-12 of it, and some of that adds up. Covariances in blocks are exact to 2e-11.
    """
    np.testing.assert_allclose(sigma, expected_sigma, rtol=2e-11)
    assert (np.abs(values - expected_values) < 1e-10 * expected_sigma).all()


@pytest.mark.parametrize("case", CASES)
def test_a_log_filtered_in_parts_is_the_log_filtered_at_once(case):
    name, more = CASES[case]
    s = settings(name, **more)
    still = name == "still"
    theta, rate, acceleration = staircase((0, 5), (0 if still else 40, 15))
    log = perfect(s.C_nb, s.axis, theta, rate, s.lever_arm, acceleration)
    gyro, accel, _, _ = sensors(np.random.default_rng(2), log)
    complete = run(build_update_model(theta, DT, s), gyro, accel)
    zupt_filter, parts, done = ZuptFilter(s, len(complete.time)), [], 0
    for count in (1, 13, 60, 7, len(complete.time) - 81):
        first, last = done * s.samples, (done + count) * s.samples
        wide = slice(max(first - s.samples, 0), last + s.samples + 1)
        within = slice(first - wide.start, last + 1 - wide.start)
        p = build_update_model(
            theta[wide][: len(complete.time) * s.samples + 1 - wide.start], DT, s, within
        )
        parts.append(
            zupt_filter.advance(p, gyro[first : last + 1], accel[first : last + 1]).estimates
        )
        done += count
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("time", "values", "sigma", "nis", "attitude_errors")
    }
    same(joined["values"], joined["sigma"], complete.values, complete.sigma)
    np.testing.assert_array_equal(joined["time"], complete.time)
    np.testing.assert_allclose(joined["nis"], complete.nis, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(joined["attitude_errors"], complete.attitude_errors, atol=1e-13)
    sigma = complete.sigma[-1]
    assert np.abs((parts[-1].P - complete.P) / np.outer(sigma, sigma)).max() < 1e-10


def test_with_a_free_azimuth_the_scale_factor_widens_the_biases_as_with_a_slaved_one():
    sigma = {}
    theta, rate, acceleration = staircase((10, 60))
    for slaved in (True, False):
        s = settings("y30", initial=InitialSigma(scale=2e-3), slave_azimuth=slaved)
        log = perfect(s.C_nb, s.axis, theta, rate, (0.0, 0.0, 0.0), acceleration)
        sigma[slaved] = run(build_update_model(theta, DT, s), *log).sigma[-1, 9:15]
    # The free azimuth is believed to be known somewhat better, which is its fault.
    np.testing.assert_allclose(sigma[False], sigma[True], rtol=0.1)
    assert sigma[False][1] > 2e-3 * 10.0 * DEG  # along the axis the scale is all there is


def histories(*args, **more):
    """Every update's values, sigma and NIS, and the result, of a log's first pass."""
    made = prepare_zupt(*args, **more)
    summary = ZuptHistory(made)
    parts = list(summary.watch(estimate_parts(made)))
    joined = [np.concatenate([getattr(p, n) for p in parts]) for n in ("time", "values", "sigma")]
    return joined, summary.result()


@pytest.fixture
def small_parts(monkeypatch):
    """Return a function that makes parts, pieces and a stream's batches small."""

    def shrink():
        monkeypatch.setattr(passes, "UPDATES", 7)
        monkeypatch.setattr(record, "CHUNK_SAMPLES", 137)
        monkeypatch.setattr(stream, "CHUNK_SAMPLES", 211)

    return shrink


OPTIONS = {
    "plain": Options(),
    "smoothed": Options(smooth=True),
    "window and rate": Options(window=(3.0, 21.0), update_rate=14.0),
    "few updates": Options(update_rate=0.05),
}


@pytest.mark.parametrize("name", OPTIONS)
def test_many_small_parts_of_a_log_give_what_few_large_ones_give(small_parts, name):
    imu, table, rig, profile = simulated(legs=((10.0, 0.0), (35.0, 20.0)))
    errors = TriadErrors(np.zeros((3, 3)), 0.9 * profile.gyro.bias)
    args = (imu, table, rig, OPTIONS[name], errors, TriadErrors(bias=profile.accel.bias))
    large, at_once = histories(*args)
    small_parts()
    small, piecewise = histories(*args)
    np.testing.assert_array_equal(small[0], large[0])
    same(*small[1:], *large[1:])
    np.testing.assert_allclose(piecewise.rms, at_once.rms, rtol=1e-9, atol=1e-14)
    np.testing.assert_allclose(piecewise.rms_attitude, at_once.rms_attitude, rtol=1e-9)
    assert piecewise.nis == pytest.approx(at_once.nis, rel=1e-9)
    assert piecewise.warnings == at_once.warnings
    np.testing.assert_array_equal(piecewise.estimates.time, at_once.estimates.time)


@pytest.mark.parametrize("pitch", [30.0, 31.0])
def test_a_log_that_is_not_stored_gives_what_a_stored_one_gives(tmp_path, small_parts, pitch):
    imu, table, rig, _ = simulated(legs=((10.0, 0.0), (30.0, 20.0)))
    names = [f"{kind}_{axis}" for kind in ("gyro", "accel") for axis in "xyz"]
    values = [*imu.gyro.T, *imu.accel.T]
    path = tmp_path / "imu.parquet"
    write_columns(path, {"time": imu.time, **dict(zip(names, values, strict=True))})
    rig = rig.override({"attitude": {"pitch": pitch}})
    stored = filter_log(imu, table, rig, Options())
    small_parts()
    log = open_imu(path, rig, in_memory_factor=0.0)
    assert isinstance(log, StreamedImuLog)
    streamed = filter_log(log, table, rig, Options())
    assert any("deg off [attitude]" in text for text in stored.warnings) == (pitch == 31.0)
    warnings = tuple(text for text in streamed.warnings if "have no unit" not in text)
    assert warnings == stored.warnings
    # The stream's even clock is that of the complete log to 1e-12.
    for a, b in zip(
        (streamed.estimates.values, streamed.estimates.sigma, streamed.rms),
        (stored.estimates.values, stored.estimates.sigma, stored.rms),
        strict=True,
    ):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)


def test_figures_are_those_of_every_update_and_not_of_the_kept_ones_alone():
    imu, table, rig, _ = simulated(legs=((50.0, 10.0),))
    (_, values, sigma), result = histories(imu, table, rig, Options())
    assert len(values) > 1.5 * len(result.estimates.time)
    np.testing.assert_allclose(result.rms, np.sqrt((values**2).mean(axis=0)), rtol=1e-13)
    np.testing.assert_array_equal(result.estimates.values[-1], values[-1])
    np.testing.assert_array_equal(result.estimates.sigma[[0, -1]], sigma[[0, -1]])
    assert len(result.estimates.time) == 301


def test_what_is_smoothed_over_a_tilted_table_is_smoothed_about_where_it_is():
    imu, table, rig, _ = simulated(legs=((60.0, 10.0),))
    right = filter_log(imu, table, rig, Options(smooth=True))
    off = rig.override({"attitude": {"pitch": 31.0}})
    found = filter_log(imu, table, off, Options(smooth=True))
    plain = filter_log(imu, table, off, Options())
    np.testing.assert_array_equal(found.estimates.values[-1], plain.estimates.values[-1])
    miss = found.estimates.values[:, 9:12] - right.estimates.values[:, 9:12]
    assert np.abs(miss).max() < 2.0 * DEG_PER_HOUR  # the prior's pull; sigmas are 30 and more


@pytest.mark.parametrize("smooth", [False, True])
def test_a_part_contains_on_to_no_matrix_of_each_update(smooth):
    imu, table, rig, _ = simulated(legs=((20.0, 10.0),))
    for part in estimate_parts(prepare_zupt(imu, table, rig, Options(smooth=smooth))):
        for name in ("time", "values", "sigma", "nis", "P"):  # a view would keep all it is of
            assert getattr(part, name).base is None, name


def test_a_history_too_long_to_be_smoothed_is_refused_before_the_work(monkeypatch):
    imu, table, rig, _ = simulated(legs=((20.0, 10.0),))
    monkeypatch.setattr(stage, "MAX_HISTORY_BYTES", 50_000)
    with pytest.raises(
        LogError,
        match=r"the history of 200 updates to be smoothed takes 7\.5e-05 GB, more than the "
        r"5e-05 GB .* "
        r"update rate of 6\.25 Hz at most, a shorter window, or omit smoothing",
    ):
        prepare_zupt(imu, table, rig, Options(smooth=True))
    assert prepare_zupt(imu, table, rig, Options(smooth=True, update_rate=6.25))
    assert prepare_zupt(imu, table, rig, Options())


def test_progress_goes_up_to_the_end_of_either_pass():
    imu, table, rig, _ = simulated(legs=((30.0, 10.0),))
    for options in (Options(), Options(smooth=True)):
        made = replace(prepare_zupt(imu, table, rig, options), tilt_offset=None)
        reported = []
        for _ in estimate_parts(made, reported.append):
            pass
        assert reported == sorted(reported)
        assert reported[-1] == 1.0


def test_a_window_between_two_samples_is_refused():
    imu, table, rig, _ = simulated(legs=((20.0, 10.0),))
    with pytest.raises(LogError, match="contains 1 samples, fewer than two updates of 10"):
        prepare_zupt(imu, table, rig, Options(window=(5.0051, 5.0052)))
