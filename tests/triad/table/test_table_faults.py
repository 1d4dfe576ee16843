"""Table logs and IMU logs with faults: gaps, shocks, sensors out of the box, coarse encoders."""

from dataclasses import replace
from functools import cache

import numpy as np

from rotcli.logs.record import ImuLog
from rotcli.logs.table_axes import AxesLog
from rotcli.models.triad import parameters as p
from rotcli.models.triad import sequences
from rotcli.rig.rig import rig_from_dict
from rotcli.simulate.sequence import SequenceSetup, simulate_sequence
from rotcli.triad.table.run import TriadOptions, calibrate_on_table
from rotcli.units import DEG
from tests.triad import bench

_RIG = {
    "site": {"latitude": 51.08, "height": 1100.0, "gravity": bench.GRAVITY},
    "table": {"axes": ["z", "x", "y"]},
    "imu": {"angle_random_walk": 0.4, "velocity_random_walk": 0.05},
}


@cache
def _logs(scale=0.0):
    """Return logs of M5 with errors of 1000 ppm; scale: error of all gyro scale factors."""
    rng = np.random.default_rng(5)
    nominal = bench.three_axes()
    setup = SequenceSetup(
        nominal.axes, nominal.C_nb, nominal.mountings, nominal.latitude, nominal.gravity
    )
    x = np.zeros(p.count())
    x[p.N] = 1e-3 + scale * np.eye(3).ravel()
    x[p.M] = -1e-3
    log = simulate_sequence(setup, sequences.m5(turns=3).motion(), x)
    y = np.column_stack([log.gyro, log.accel])
    y += bench.SIGMA_1 * rng.standard_normal(y.shape)
    angles = log.angles + 1e-5 * DEG * rng.standard_normal(log.angles.shape)
    imu = ImuLog("imu", log.time, y[:, :3], y[:, 3:], 0.01, rows=len(y))
    table = AxesLog("table", log.table_time, angles, 0.02, len(angles), (), None)
    return x, imu, table


def _calibrate(imu, table):
    return calibrate_on_table(imu, table, rig_from_dict(_RIG), TriadOptions())


def _errors(result, x):
    """Return the error over sigma of the gyro matrix."""
    factors = p.unit_factors()
    return np.array(
        [
            (e.value - x[p.INDEX[e.name]] / factors[p.INDEX[e.name]]) / e.sigma
            for e in result.estimates
            if e.name in p.GROUPS["N"].names
        ]
    )


def _codes(result):
    return {f.code for f in result.findings}


def test_a_gap_of_the_table_log_costs_only_its_blocks():
    x, imu, table = _logs()
    kept = np.delete(np.arange(len(table.time)), np.arange(3000, 3100))
    cut = replace(table, time=table.time[kept], angles=table.angles[kept])
    result = _calibrate(imu, cut)
    assert np.abs(_errors(result, x)).max() < 4.0
    assert _codes(result) == set()


def test_gyros_with_a_scale_error_of_a_quarter_are_calibrated():
    x, imu, table = _logs(scale=-0.25)
    result = _calibrate(imu, table)
    assert np.abs(_errors(result, x)).max() < 4.0
    assert _codes(result) == set()


def test_a_shock_is_reported_with_its_time():
    _, imu, table = _logs()
    accel = imu.accel.copy()
    accel[12_000:12_040, 1] += 2.0
    result = _calibrate(replace(imu, accel=accel), table)
    found = [f for f in result.findings if f.code == "disturbed-blocks"]
    assert len(found) == 1
    assert "accel_y" in found[0].text
    assert abs(float(found[0].where.split()[0]) - 120.2) < 0.5


def test_an_encoder_that_is_too_coarse_is_reported():
    _, imu, table = _logs()
    step = 2.0 * np.pi / 2**12
    result = _calibrate(imu, replace(table, angles=np.round(table.angles / step) * step))
    assert "little-used" in _codes(result)
