"""One rule for still and turning: the commands agree, whatever the noise of the encoder."""

import json

import numpy as np
import pandas as pd
import pytest

from rotcli.logs.record import TableLog
from rotcli.run.motion import angle_range, is_still, motion_between
from rotcli.units import DEG

TIME = np.arange(0.0, 300.0, 0.02)


@pytest.fixture
def noisy_still(rotcli, tmp_path):
    """Return the folder of a still run whose table angle has noise of 1e-5 deg."""
    run = tmp_path / "still"
    made = rotcli("simulate", "--imu", "nav440", "--rate", 0, "--static", 60, "--navigation", 120,
                  "--seed", 1, "-o", run)  # fmt: skip
    assert made.status == 0, made.err
    table = pd.read_parquet(run / "table.parquet")
    name = next(c for c in table.columns if c.startswith("angle"))
    rng = np.random.default_rng(1)
    factor = DEG if "rad" in name else 1.0
    table[name] = table[name] + factor * 1e-5 * rng.standard_normal(len(table))
    table.to_parquet(run / "table.parquet")
    return run


def test_commands_agree_that_a_table_with_encoder_noise_is_still(rotcli, noisy_still):
    logs = noisy_still / "imu.parquet", noisy_still / "table.parquet"
    result, report = noisy_still / "n.json", noisy_still / "report.md"
    done = rotcli("navigate", *logs, "--mode", "conventional", "-o", result)
    assert done.status == 0, done.err
    assert "turns" not in done.err
    assert json.loads(result.read_text())["rate"]["value"] == 0.0
    assert rotcli("report", result, "-o", report).status == 0
    assert "still" in report.read_text()

    saved = noisy_still / "c.json"
    seen = noisy_still / "o.json"
    done = rotcli("observe", *logs, "--save-calibration", saved, "-o", seen)
    assert done.status == 0, done.err
    states = json.loads(seen.read_text())["filter"]["estimates"]
    assert not [name for name in states if name.startswith("Kg")], "no scale states when still"
    done = rotcli("navigate", *logs, "--mode", "partial", "--calibration", saved, "-o", result)
    assert done.status == 0, done.err


@pytest.mark.parametrize("sigma", [0.0, 1e-5, 1e-3, 0.05])
def test_noise_of_the_encoder_is_no_motion(sigma):
    rng = np.random.default_rng(2)
    for _ in range(20):
        table = TableLog("t", TIME, sigma * DEG * rng.standard_normal(len(TIME)), 0.02)
        motion = motion_between(table, 0.0, 299.0)
        assert motion.still
        assert (motion.rate, motion.constant_rate) == (0.0, True)


def test_an_oscillation_that_ends_where_it_began_is_not_still():
    table = TableLog("t", TIME, 5.0 * DEG * np.sin(2 * np.pi * TIME / 10.0), 0.02)
    motion = motion_between(table, 0.0, 290.0)
    assert not motion.still
    assert not motion.constant_rate
    assert angle_range(table, 0.0, 290.0) > 9.0 * DEG


def test_a_slow_rotation_is_still_up_to_the_stated_rate_only():
    for rate, still in ((0.9e-4, True), (1.1e-4, False)):
        table = TableLog("t", TIME, rate * DEG * TIME, 0.02)
        assert motion_between(table, 0.0, 299.0).still == still
    assert is_still(0.009 * DEG, 1.0)
    assert not is_still(0.011 * DEG, 1.0)
    assert is_still(0.5 * DEG, 1.0, resolution=0.3 * DEG)
