"""Simulated logs for the ZUPT filter."""

from rotcli.rig.profile import read_profile
from rotcli.rig.rig import rig_from_dict
from rotcli.rig.scenario import Leg, Scenario
from rotcli.simulate.estimate import simulate
from rotcli.units import DEG

SITE = {"latitude": 51.08, "height": 1100.0}


FIGURES = {
    "angle_random_walk": 3.0,
    "velocity_random_walk": 0.12,
    "rate_random_walk": 2.6,
    "bias_instability": 8.3,
    "accel_bias_instability": 1.8e-3,
}


def simulated(axis="y", pitch=30.0, roll=0.0, legs=((100.0, 10.0),), seed=0, imu=None, **more):
    """Records of a simulated mti-g log, its rig and its profile."""
    rig = rig_from_dict(
        {
            "site": SITE,
            "attitude": {"pitch": pitch, "roll": roll, "azimuth": 20.0},
            "table": {"axis": axis},
            "imu": imu or FIGURES,
        }
    )
    profile = read_profile("mti-g")
    scenario = Scenario(
        profile, tuple(Leg(t, r * DEG) for t, r in legs), rig=rig, seed=seed, **more
    )
    made = simulate(scenario)
    return made.imu, made.table, rig, profile
