"""Calibrations over rate and temperature together: simulate, calibrate, navigate.

The thermal test turns at 50 deg/s, the navigation at 100 deg/s and another temperature.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from rotcli.models.laboratory.environment import Environment, RateNonlinearity
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import rig_from_dict
from rotcli.rig.scenario import Leg, Scenario
from rotcli.simulate.api import simulate_run
from tests.scale.sets import ALTERNATING, DEG, DPH, PPM

FIGURES = """[imu]
angle_random_walk = 0.4
bias_instability = 15.66
rate_random_walk = 0.35
velocity_random_walk = 0.05
"""
SOAKS = [0, 10, 20, 30, 40, 40, 30, 20, 10, 0]


class Chain:
    """Scale test, thermal test and navigation of one simulated IMU, with or without effects."""

    def __init__(self, folder, laboratory, rotcli, *, imu="ideal", effects=True, seed=1):
        self.folder, self.rig, self.rotcli = Path(folder), rig_from_dict(laboratory), rotcli
        self.imu, self.effects, self.seed = imu, effects, seed

    def simulate(self, name, legs, points, seed):
        around = Environment(temperature=np.array(points, float))
        if self.effects:
            around = Environment(
                temperature=np.array(points, float),
                gyro_bias=np.tile(np.array([10, -0.09375, 0.00125]) * DPH, (3, 1)),
                gyro_scale=np.tile(np.array([37.5, 0.25]) * PPM, (3, 1)),
                nonlinearity=RateNonlinearity(100 * DEG, 30 * DPH, -60 * DPH),
            )
        scenario = Scenario(
            read_profile(self.imu),
            tuple(legs),
            self.rig,
            ramp=2.0,
            seed=100 * self.seed + seed,
            environment=around,
        )
        simulate_run(scenario).write(str(self.folder / name))
        if self.imu == "ideal":  # noise figures only weigh the fit
            path = self.folder / name / "rig.toml"
            path.write_text(path.read_text().replace("[imu]\n", FIGURES))
        return [self.folder / name / f"{log}.parquet" for log in ("imu", "table")]

    def call(self, *arguments):
        outcome = self.rotcli(*arguments)
        assert outcome.status == 0, outcome.err

    def scale(self, *options, seconds=20.0):
        legs = [Leg(seconds, rate * DEG) for rate in ALTERNATING]
        logs = self.simulate("scale", legs, [[0, 25]], 1)
        self.call("scale", *logs, *options, "-o", self.folder / "scale.json")

    def thermal(self, *options, still=20.0, turning=12.0, change=60.0):
        legs, points, now = [], [], 0.0
        for k, T in enumerate(SOAKS):
            legs += [Leg(still), Leg(turning, 50 * DEG), Leg(turning, -50 * DEG)]
            points += [[now, T], [now + still + 2 * turning + 6, T]]
            now += still + 2 * turning + 6
            if k + 1 < len(SOAKS):
                legs.append(Leg(change))
                now += change
        logs = self.simulate("thermal", legs, points, 2)
        self.call("thermal", *logs, *options, "-o", self.folder / "thermal.json")

    def navigate(self, *calibrations, duration=300.0):
        legs = [Leg(20.0, stage="static"), Leg(duration, 100 * DEG, stage="navigation")]
        if not (self.folder / "nav").exists():
            self.simulate("nav", legs, [[0, 15], [duration + 22, 35]], 3)
        logs = [self.folder / "nav" / f"{log}.parquet" for log in ("imu", "table")]
        used = [part for name in calibrations for part in ("--calibration", self.folder / name)]
        path = self.folder / "nav.json"
        self.call("navigate", *logs, "--mode", "full", *used, "-o", path)
        return json.loads(path.read_text())


def test_scale_and_thermal_calibrations_together_leave_little(laboratory, rotcli, tmp_path):
    chain = Chain(tmp_path, laboratory, rotcli)
    chain.scale("--model", "cubic")
    chain.thermal("--order", "3,2")
    both = chain.navigate("scale.json", "thermal.json", duration=100.0)
    thermal = chain.navigate("thermal.json", duration=100.0)
    # Deviation of the curve at 100 deg/s from the line through 0 and +-50: -16 deg/h odd, 25 even.
    assert abs(both["final"]["azimuth_deg"]) < 0.05  # 2 deg/h over 100 s
    assert abs(thermal["final"]["azimuth_deg"]) > 3 * abs(both["final"]["azimuth_deg"])


def test_a_scale_curve_adds_what_a_calibration_at_one_rate_lacks(laboratory, rotcli, tmp_path):
    chain = Chain(tmp_path, laboratory, rotcli)
    constant = [[0, 20.0]]  # the reference temperature: no thermal errors
    legs = [Leg(20.0, rate * DEG) for rate in ALTERNATING]
    chain.call(
        "scale",
        *chain.simulate("scale", legs, constant, 1),
        *("--model", "cubic", "-o", tmp_path / "scale.json"),
    )
    logs = chain.simulate("column", [Leg(20.0), Leg(20.0, 50 * DEG)], constant, 2)
    chain.call("calibrate", *logs, "-o", tmp_path / "column.json")
    nav = [Leg(20.0, stage="static"), Leg(100.0, 100 * DEG, stage="navigation")]
    chain.simulate("nav", nav, constant, 3)
    final = {}
    for names in (("column.json",), ("column.json", "scale.json"), ("scale.json",)):
        used = [part for name in names for part in ("--calibration", tmp_path / name)]
        run = [tmp_path / "nav" / f"{log}.parquet" for log in ("imu", "table")]
        chain.call("navigate", *run, "--allow-other-rate", *used, "-o", tmp_path / "nav.json")
        doc = json.loads((tmp_path / "nav.json").read_text())
        final[names] = abs(doc["final"]["azimuth_deg"])
    # e(100) - 2 e(50) = -30 deg/h: 0.83 deg after 100 s.
    assert final["column.json",] == pytest.approx(0.83, abs=0.01)
    assert final["column.json", "scale.json"] < 0.005
    assert final["scale.json",] < 0.005


@pytest.mark.campaign
def test_effects_that_are_calibrated_do_not_enlarge_the_navigation_error(
    laboratory, rotcli, tmp_path
):
    squares = np.zeros((2, 2))
    for seed in range(6):
        for k, effects in enumerate((True, False)):
            chain = Chain(
                tmp_path / f"{seed}{effects}",
                laboratory,
                rotcli,
                imu="nav440",
                effects=effects,
                seed=seed,
            )
            chain.scale(seconds=60.0)
            chain.thermal(still=120.0, turning=60.0, change=200.0)
            rms = chain.navigate("scale.json", "thermal.json")["rms"]
            squares[k] += rms["horizontal_m"] ** 2, rms["azimuth_deg"] ** 2
    ratio = np.sqrt(squares[0] / squares[1])  # 1.010 in position, 1.007 in azimuth
    assert np.all(ratio < 1.1)
