"""Table logs as labs write them: rates, counts, ranges, records that are wrong."""

import numpy as np
import pytest

from rotcli.errors import LogError
from rotcli.logs.table import read_table
from rotcli.rig.rig import default_rig, rig_from_dict
from tests.logs.lab_logs import ANGLE, DEG, TT, table_log


def test_a_table_log_of_rates_is_integrated(tmp_path):
    rate = np.where(TT < 20, 0.0, 20.0)
    path = table_log(tmp_path / "t.csv", ["time [s]", "rate [deg/s]"], [TT, rate])
    table = read_table(path, default_rig())
    assert 'It is integrated; set [table] quantity = "rate"' in table.warnings[0]
    # The trapezoid across the step is off by half a record's turn, 0.4 deg.
    np.testing.assert_allclose(table.angle / DEG, ANGLE, atol=0.41)
    quiet = rig_from_dict({"table": {"quantity": "rate"}})
    assert read_table(path, quiet).warnings == ()


def test_encoder_counts_and_other_wraps_are_recognised(tmp_path):
    counts = np.floor(ANGLE / 360 * 4096) % 4096
    path = table_log(tmp_path / "c.csv", ["time [s]", "encoder"], [TT, counts], form="%.10g")
    with pytest.raises(LogError, match=r"encoder counts; set \[table\] counts_per_turn = 4096"):
        read_table(path, default_rig())
    table = read_table(path, rig_from_dict({"table": {"counts_per_turn": 4096}}))
    np.testing.assert_allclose(table.angle / DEG, ANGLE, atol=360 / 4096)
    wrapped = ANGLE % 327.68
    path = table_log(tmp_path / "w.csv", ["time [s]", "angle [deg]"], [TT, wrapped])
    table = read_table(path, default_rig())
    assert "starts again after 327.68 deg, not after a turn" in table.warnings[0]
    np.testing.assert_allclose(table.angle / DEG, ANGLE, atol=1e-6)
    named = read_table(path, rig_from_dict({"table": {"wrap": 327.68}}))
    assert named.warnings == ()
    np.testing.assert_allclose(named.angle, table.angle)


def test_one_record_outside_the_range_is_named_and_omitted(tmp_path):
    wrapped = ANGLE % 360
    wrapped[700] = 4711.0
    path = table_log(tmp_path / "o.csv", ["time [s]", "angle [deg]"], [TT, wrapped])
    table = read_table(path, default_rig())
    assert (
        "angle is 4711 deg at 28 s, outside of the range of all other records (row 702)"
        in table.warnings[0]
    )
    np.testing.assert_allclose(table.angle / DEG, np.delete(ANGLE, 700), atol=1e-6)


def test_the_one_of_three_columns_that_moves_is_the_axis(tmp_path):
    names = ["time [s]", "outer [deg]", "middle [deg]", "inner [deg]"]
    cells = [TT, 0 * TT + 3.0, 0 * TT, ANGLE % 360]
    table = read_table(table_log(tmp_path / "m.csv", names, cells), default_rig())
    assert 'only inner moves. It is used; set [table] column = "inner"' in table.warnings[0]
    np.testing.assert_allclose(table.angle / DEG, ANGLE, atol=1e-6)


def test_table_logs_take_the_same_dialects(tmp_path):
    cells = [[f"{v:.6f}".replace(".", ",") for v in column] for column in (TT, ANGLE)]
    path = table_log(
        tmp_path / "d.csv", ["Zeit", "Winkel"], cells, head="Tisch 7\n\n", delimiter=";"
    )
    setup = {"columns": {"time": "Zeit", "angle": "Winkel"}, "units": "deg"}
    table = read_table(path, rig_from_dict({"table": setup}))
    np.testing.assert_allclose(table.angle / DEG, ANGLE, atol=1e-6)


def test_unlabelled_degrees_that_wrap_at_360_are_reported(tmp_path):
    path = table_log(tmp_path / "n.csv", ["time", "angle"], [TT, (ANGLE % 360).round(3)])
    with pytest.raises(LogError, match=r'after 360 .*: degrees; set \[table\] units = "deg"'):
        read_table(path, default_rig())


def test_brackets_that_say_counts_lead_to_the_scale(tmp_path):
    path = table_log(tmp_path / "c.csv", ["time [s]", "Position (counts)"],
                     [TT, np.floor(ANGLE / 360 * 4096) % 4096])  # fmt: skip
    with pytest.raises(LogError, match=r"encoder counts; set \[table\] counts_per_turn"):
        read_table(path, default_rig())


def test_a_record_a_little_above_a_turn_does_not_stop_the_unwrapping(tmp_path):
    wrapped = ANGLE % 360
    wrapped[700] = 361.0
    path = table_log(tmp_path / "o.csv", ["time [s]", "angle [deg]"], [TT, wrapped])
    table = read_table(path, default_rig())
    assert "angle is 361 deg at 28 s" in table.warnings[0]
    np.testing.assert_allclose(table.angle / DEG, np.delete(ANGLE, 700), atol=1e-6)


def test_an_encoder_that_slips_beyond_a_turn_is_unwrapped_and_named(tmp_path):
    true = ANGLE + np.where(TT < 25, 0.0, 5.0)
    wrapped = np.where(TT < 25, true % 360, (true - 5) % 360 + 5)
    path = table_log(tmp_path / "s.csv", ["time [s]", "angle [deg]"], [TT, wrapped])
    table = read_table(path, default_rig())
    count = int(np.count_nonzero(wrapped >= 360))
    assert f"after a turn, but {count} records are outside" in table.warnings[0]
    np.testing.assert_allclose(table.angle / DEG, true, atol=1e-6)


def test_an_angle_that_starts_again_after_a_turn_of_another_unit_asks_for_it(tmp_path):
    path = table_log(tmp_path / "g.csv", ["time [s]", "angle [deg]"], [TT, (ANGLE / 0.9) % 400])
    with pytest.raises(LogError, match=r'a turn in gon, but .*; set \[table\] units = "gon"'):
        read_table(path, default_rig())
    table = read_table(path, rig_from_dict({"table": {"units": "gon"}}))
    np.testing.assert_allclose(table.angle / DEG, ANGLE, atol=1e-6)


@pytest.mark.parametrize("period", [327.68, 720.0, 163.84])
def test_a_swinging_table_is_unwrapped_at_any_range(tmp_path, period):
    swing = 300 * np.sin(TT / 5)
    path = table_log(tmp_path / "w.csv", ["time [s]", "angle [deg]"], [TT, swing % period])
    angle = read_table(path, default_rig()).angle / DEG
    np.testing.assert_allclose(angle - angle[0], swing, atol=1e-6)
