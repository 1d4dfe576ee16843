"""Several axes and several mountings in a rig, and the log of a table of several axes."""

import numpy as np
import pytest

from rotcli.errors import LogError, RigError
from rotcli.logs.table_axes import read_table_axes, table_axes
from rotcli.rig.rig import rig_from_dict
from rotcli.units import DEG

_TURNED = [[0, 1, 0], [-1, 0, 0], [0, 0, 1]]


def test_axes_and_mountings_survive_a_round_trip():
    values = {
        "site": {"latitude": 51.08, "gravity": 9.8083, "gravity_sigma": 1e-5},
        "attitude": {"azimuth": 0.0, "azimuth_sigma": 0.2},
        "table": {"axes": ["z", [0.6, 0.8, 0.0]], "directions": [1, -1]},
        "mountings": [
            {"from": 0.0, "to": 100.0, "mount": np.eye(3).tolist(), "sigma": 0.0},
            {"from": 120.0, "to": 220.0, "mount": _TURNED},
        ],
    }
    rig = rig_from_dict(values)
    again = rig_from_dict(rig.effective())
    assert again == rig
    assert [m.sigma for m in again.mountings] == [0.0, None]
    assert again.attitude.azimuth_sigma == pytest.approx(0.2 * DEG)
    np.testing.assert_allclose(table_axes(again)[1], [0.6, 0.8, 0.0])


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"mountings": [{"from": 5.0, "to": 2.0, "mount": _TURNED}]}, "ends before it starts"),
        ({"mountings": [{"from": 0.0, "to": 2.0}]}, "mount: missing"),
        ({"mountings": [{"form": 0.0}]}, "similar: from"),
        ({"mountings": {"from": 0.0}}, "not a list of tables"),
        ({"table": {"axes": []}}, "1 to 3 axes"),
        ({"table": {"directions": [1, 2]}}, "list of 1 and -1"),
    ],
)
def test_a_wrong_axis_or_mounting_is_named(changes, text):
    with pytest.raises(RigError, match=text):
        rig_from_dict(changes)


def test_overlapping_mountings_are_an_error():
    one = {"from": 0.0, "to": 100.0, "mount": _TURNED}
    two = {"from": 90.0, "to": 200.0, "mount": _TURNED}
    with pytest.raises(RigError, match=r"\[\[mountings\]\] 2: overlaps"):
        rig_from_dict({"mountings": [one, two]})


def _write(path, rows):
    lines = ["time [s],outer [deg],middle [deg],inner [deg]"]
    lines += [f"{t:.2f},{a:.4f},{b:.4f},{c:.4f}" for t, a, b, c in rows]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def test_every_axis_of_a_table_log_is_unwrapped_and_signed(tmp_path):
    t = np.arange(0.0, 20.0, 0.02)
    rows = np.column_stack([t, (60 * t) % 360, 0 * t, -10 * t])
    path = _write(tmp_path / "table.csv", rows)
    rig = rig_from_dict({"table": {"axes": ["z", "x", "y"], "directions": [1, 1, -1]}})
    log = read_table_axes(path, rig)
    assert log.angles.shape == (len(t), 3)
    np.testing.assert_allclose(
        log.angles[-1], np.array([60 * t[-1], 0, 10 * t[-1]]) * DEG, atol=1e-6
    )


def test_a_missing_axis_column_is_named(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("time [s],outer [deg]\n0,0\n0.02,0\n0.04,0\n")
    rig = rig_from_dict({"table": {"axes": ["z", "x"]}})
    with pytest.raises(LogError, match="inner"):
        read_table_axes(str(path), rig)


def test_directions_must_fit_the_axes(tmp_path):
    rig = rig_from_dict({"table": {"axes": ["z", "x"], "directions": [1]}})
    with pytest.raises(RigError, match="1 for 2 axes"):
        read_table_axes(tmp_path / "absent.csv", rig)


def test_the_columns_of_the_axes_may_be_a_list(tmp_path):
    path = tmp_path / "table.csv"
    rows = "\n".join(f"{0.02 * k:.2f},{k},{2 * k}" for k in range(20))
    path.write_text(f"time [s],A [deg],B [deg]\n{rows}\n")
    rig = rig_from_dict({"table": {"axes": ["x", "z"], "columns": ["A", "B"]}})
    log = read_table_axes(str(path), rig)
    np.testing.assert_allclose(log.angles[3], np.array([3.0, 6.0]) * DEG)
    assert rig_from_dict(rig.effective()) == rig
