"""100 odd logs are read to the right arrays, or their message says the lines that make them so."""

import re
import tomllib

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.imu import read_imu
from rotcli.rig.rig import default_rig
from tests.logs.describe.odd_logs import RATE, odd_log

_LINE = re.compile(r'\[imu\] (\w+) = (\{[^}]*\}|"[^"]*"|[-\w.]+)')


def advised(message):
    """The rig keys that a message says; a rate is the operator's to know."""
    keys = {}
    for key, value in _LINE.findall(message):
        keys[key] = tomllib.loads(f"{key} = {value}")[key]
    if "rate" in keys:
        keys["rate"] = RATE
    return {"imu": keys}


@pytest.mark.parametrize("seed", range(100))
def test_an_odd_log_is_read_right_or_says_how(tmp_path, seed):
    odd = odd_log(seed)
    path = tmp_path / "log.txt"
    path.write_bytes(odd.content)
    rig = default_rig()
    for _ in range(3):
        try:
            log = read_imu(path, rig, max_gap=None)
            break
        except LogError as error:
            lines = advised(str(error))
            if not lines["imu"]:
                pytest.fail(f"no advice: {error} {odd.what}")
            rig = rig.override(lines)
    else:
        pytest.fail(f"not readable after three rounds of advice: {odd.what}")
    assert log.samples == len(odd.gyro), f"{log.warnings} {odd.what}"
    # Twelve digits are written; units and temperatures round once more.
    np.testing.assert_allclose(log.gyro, odd.gyro, rtol=1e-9, atol=1e-12, err_msg=str(odd.what))
    np.testing.assert_allclose(log.accel, odd.accel, rtol=1e-9, err_msg=str(odd.what))
    # Coarse stamps of 0.5 s over 2.4 s show the rate to some percent.
    tolerance = 0.1 if odd.time == "coarse" else 0.01
    assert log.interval == pytest.approx(1.0 / RATE, rel=tolerance), odd.what
