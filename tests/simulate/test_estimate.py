"""Simulated logs: what was asked for is in them, and only that."""

from dataclasses import replace

import numpy as np
import pytest

from rotcli.rig.profile import read_profile
from rotcli.rig.scenario import Leg
from rotcli.simulate.estimate import simulate

DEG = np.pi / 180


def test_the_stages_lie_where_the_table_does_what_they_say(papers_run):
    made = simulate(papers_run(rate=20.0, navigation=30.0))
    assert made.stages == {
        "static": [(0.0, 60.0)],
        "rotation": [(61.0, 121.0)],
        "navigation": [(121.0, 151.0)],
    }
    assert len(made.imu.time) == 15_101  # 100 Hz, both ends
    assert len(made.table.time) == 7_551  # 50 Hz
    angle, time = made.table.angle, made.table.time
    assert np.ptp(angle[time <= 60.0]) == 0.0
    turning = (time >= 61.0) & (time <= 151.0)
    np.testing.assert_allclose(np.diff(angle[turning]) / 0.02, 20 * DEG, rtol=1e-4)


def test_progress_rises_in_equal_steps_for_the_six_sensors_and_ends_at_one(papers_run):
    shares = []
    simulate(papers_run(rate=20.0, static=5.0, rotation=5.0), progress=shares.append)
    assert shares[-1] == pytest.approx(1.0)
    steps = np.diff(shares[-7:])
    np.testing.assert_allclose(steps, np.full(6, (1.0 - shares[-7]) / 6.0))


def test_an_ideal_imu_on_a_turning_table_reads_the_table_rate_and_the_earth(papers_run):
    made = simulate(papers_run(rate=-30.0))
    turning = made.imu.between(61.0, 121.0)  # five turns: Earth rate cancels on x and y
    mean = made.imu.gyro[turning][:-1].mean(axis=0)
    up = 7.292115e-5 * np.sin(51.08 * DEG)
    np.testing.assert_allclose(mean, [0, 0, -30 * DEG + up], atol=1e-12)


def test_the_same_seed_makes_the_same_log_and_another_seed_another(papers_run):
    one, again, other = (simulate(papers_run("mti-g", seed=s)).imu.gyro for s in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert np.abs(one - other).max() > 0


def test_the_encoder_moves_in_steps(papers_run):
    step = 0.01 * DEG
    made = simulate(replace(papers_run(rate=1.0), encoder_step=step))
    counts = made.table.angle / step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    assert len(np.unique(np.round(counts))) > 1000


def test_readings_stop_at_the_range_of_the_profile(papers_run):
    made = simulate(papers_run("mti-g", rate=310.0))
    assert made.imu.gyro[:, 2].max() == pytest.approx(300 * DEG, abs=1e-12)


def test_averages_and_instants_describe_the_same_motion(papers_run):
    instant = simulate(papers_run(rate=50.0))
    average = simulate(papers_run(rate=50.0, imu={"sampling": "average"}, attitude={"pitch": 30.0}))
    assert (instant.imu.sampling, average.imu.sampling) == ("instant", "average")
    # The table turns by the integral of the mean rate about z.
    turned = np.sum(average.imu.gyro[1:, 2]) * 0.01
    up = 7.292115e-5 * (np.sin(51.08 * DEG) * np.cos(30 * DEG) - np.cos(51.08 * DEG) * 0.5)
    assert turned - up * 121.0 == pytest.approx(made_angle(average), abs=1e-8)


def made_angle(simulation):
    return simulation.schedule.motion(np.array([121.0]))[0][0]


def test_a_mean_over_many_runs_shows_the_errors_of_the_profile(papers_run):
    profile = read_profile("nav440")
    runs = [simulate(papers_run("nav440", rate=40.0, seed=s)).imu for s in range(20)]
    still = np.mean([imu.gyro[:6000].mean(axis=0) for imu in runs], axis=0)
    earth = 7.292115e-5 * np.array([0, np.cos(51.08 * DEG), np.sin(51.08 * DEG)])
    # Flicker B 15.7 deg/h over a minute from its start scatters 0.8 B; white noise 3 deg/h.
    sigma = 13.0 * DEG / 3600 / np.sqrt(20)
    np.testing.assert_allclose(still - earth, profile.gyro.bias, atol=4 * sigma)
    turning = np.mean([imu.gyro[6200:12100].mean(axis=0) for imu in runs], axis=0)
    column = profile.gyro.matrix[:, 2] * 40 * DEG + [0, 0, 40 * DEG] + [0, 0, earth[2]]
    np.testing.assert_allclose(turning - still + earth, column + earth * [0, 1, 0], atol=6 * sigma)


def test_legs_of_different_rates_are_joined_by_ramps(papers_run):
    scenario = replace(
        papers_run(), legs=(Leg(10.0), Leg(10.0, 10 * DEG), Leg(10.0, -10 * DEG)), ramp=2.0
    )
    made = simulate(scenario)
    assert made.schedule.duration == 34.0
    rate = np.diff(made.schedule.motion(made.imu.time)[0]) / 0.01
    assert np.abs(np.diff(rate)).max() < 11 * DEG * 0.01  # never faster than the ramps
