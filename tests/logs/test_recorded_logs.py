"""Recorded logs are read as they are."""

from itertools import pairwise

import numpy as np
import pytest

from rotcli.logs.imu import read_imu
from rotcli.logs.table import read_table
from rotcli.rig.rig import default_rig, read_rig
from tests.recorded import shared


@pytest.mark.parametrize("name", ["yaw_slow", "pitch_slow"])
def test_the_swinging_mpu6050_is_read_as_its_logger_wrote_it(name):
    folder = shared("data", "uiuc_mpu6050_swing", name)
    rig = read_rig(folder / "rig.toml")
    log = read_imu(folder / "imu.csv", rig, max_gap=None)
    table = read_table(folder / "table.csv", rig)
    assert 1.0 / log.interval == pytest.approx(100.0, rel=2e-3)
    text = (folder / "imu.csv").read_text().splitlines()[1:]
    stamps = [line.partition(",")[0] for line in text]
    twice = [a == b for a, b in pairwise(text)]
    # Every record that is no repetition is a sample; skipped stamps are gaps.
    assert log.rows == len(text) - sum(twice)
    span = float(stamps[-1]) - float(stamps[0])
    assert log.samples == pytest.approx(span / log.interval + 1, abs=1)
    assert any("identical record" in warning for warning in log.warnings) == any(twice)
    assert np.all(np.diff(table.time) > 0.0)
    assert np.ptp(table.angle) > np.radians(170.0)


def test_the_recorded_xsens_log_causes_no_warning_of_its_layout():
    log = read_imu(shared("data", "xsens_mti_multiposition.csv"), default_rig(), max_gap=None)
    assert 1.0 / log.interval == pytest.approx(100.0, rel=1e-3)
    assert not any("unit" in text or "counted" in text or "count" in text for text in log.warnings)
