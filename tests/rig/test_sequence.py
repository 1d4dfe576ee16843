"""Sequence files: named sequences, round trips, errors that name step and key."""

import numpy as np
import pytest

from rotcli.errors import RigError
from rotcli.models.triad import parameters as p
from rotcli.models.triad.motion import Go, Hold, Mount, Spin
from rotcli.rig.sequence import read_sequence, sequence_text
from rotcli.units import DEG

_FILE = """
axes = ["x", [0.0, 0.6, 0.8]]
acceleration = 30
slew_rate = 15
[[steps]]
go = [0, 45]
[[steps]]
hold = 20
[[steps]]
mount = 2
[[steps]]
spin = "inner"
rate = 100
turns = 2.5
both = false
[[mountings]]
mount = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]
[errors]
gsens_xy = 12
lever_x_x = 50
"""


def _write(tmp_path, text):
    path = tmp_path / "s.toml"
    path.write_text(text)
    return str(path)


def test_a_file_is_read_in_si(tmp_path):
    found = read_sequence(_write(tmp_path, _FILE))
    assert found.steps == (
        Go((0.0, 45 * DEG)), Hold(20.0), Mount(1), Spin(1, 100 * DEG, 2.5, False),
    )  # fmt: skip
    assert (found.acceleration, found.slew_rate) == (30 * DEG, 15 * DEG)
    np.testing.assert_allclose(found.axes[1], [0, 0.6, 0.8])
    np.testing.assert_allclose(found.mountings[1], np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]))
    assert found.errors[p.INDEX["gsens_xy"]] == pytest.approx(12 * p.G_UNIT)
    assert found.errors[p.INDEX["lever_x_x"]] == pytest.approx(0.05)
    motion = found.motion()
    assert set(motion.mounting.tolist()) == {0, 1}
    assert motion.at(np.array([motion.duration]))[0][1, 0] == pytest.approx(
        45 * DEG + 2 * np.pi * 2.5 + (100 * DEG) ** 2 / (30 * DEG)
    )


@pytest.mark.parametrize("name", ["S1", "S2", "M5", "faces"])
def test_named_sequences_survive_a_round_trip(tmp_path, name):
    one = read_sequence(name)
    again = read_sequence(_write(tmp_path, sequence_text(one, "remark")))
    assert again.motion().duration == pytest.approx(one.motion().duration, abs=1e-6)
    assert len(again.steps) == len(one.steps)
    np.testing.assert_array_equal(again.axes, one.axes)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("axes = ['z']", "give 1 to 10000 tables"),
        ("[[steps]]\nhold = -1", "-1 is out of range; allowed: 0 to"),
        ("[[steps]]\nhold = 1\ngo = [1]", "exactly one of go, hold, spin, mount"),
        ("axes = ['z']\n[[steps]]\ngo = [1, 2]", "not a list of 1 angles"),
        ("axes = ['z']\n[[steps]]\nspin = 'outer'\nrate = 5", "must be one of axis"),
        ("axes = ['z']\n[[steps]]\nspin = 'axis'", "rate: None is not a number"),
        ("axes = ['z']\n[[steps]]\nspin = 'axis'\nrate = 0", "above 0"),
        ("[[steps]]\nmount = 2", "mount: 2 is not 1 to 1"),
        ("[[steps]]\nstay = 2", "stay: unknown key"),
        ("[[steps]]\ngo = [3]", "no hold and no spin"),
        ("axes = ['w']\n[[steps]]\nhold = 1", "axes: 'w'"),
        ("axes = ['z', 0, 45, 45]\n[[steps]]\nhold = 1", "is not a list of 1 to 3 axes"),
        ("axes = []\n[[steps]]\nhold = 1", "is not a list of 1 to 3 axes"),
        ("[[steps]]\ngo = [1, 2, 3, 4]", "is not 1 to 3 angles"),
        ("[[steps]]\nhold = 1\n[errors]\nKgq = 1", "similar: Kg"),
        ("[[steps]\nhold", "not TOML"),
    ],
)
def test_a_fault_is_named(tmp_path, text, message):
    with pytest.raises(RigError, match=message):
        read_sequence(_write(tmp_path, text))


def test_a_name_that_is_no_file_lists_the_named_sequences():
    with pytest.raises(RigError, match="S1, S2, M5, faces"):
        read_sequence("S7")
