"""Table logs and reference logs: columns, units, unwrapping."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rotcli.errors import LogError
from rotcli.logs.imu import read_reference, write_columns
from rotcli.logs.table import read_table
from rotcli.rig.rig import rig_from_dict
from tests.logs.test_imu import DEG, RIG, put, text


def test_the_rig_names_the_tables_columns_and_units(tmp_path):
    lines = [f"{1403636579758555392 + i * 20000000},{i}" for i in range(9)]
    path = put(tmp_path, text(lines, "Marke,Winkel"), "table.csv")
    columns = {"time": "Marke", "angle": "Winkel"}
    rig = rig_from_dict({"table": {"columns": columns, "units": {"time": "ns", "angle": "deg"}}})
    log = read_table(path, rig)
    # 0.24 us is one step of a float64 of 1.4e9 s.
    np.testing.assert_allclose(log.time - 1403636579.758555392, 0.02 * np.arange(9), atol=2.5e-7)
    np.testing.assert_allclose(log.angle, np.radians(np.arange(9)), rtol=1e-15)

    with pytest.raises(LogError, match=r"no time column"):
        read_table(path, rig_from_dict({"table": {"column": "Winkel"}}))


def test_table_column_must_be_named_when_it_is_not_angle(tmp_path):
    path = put(tmp_path, b"time,outer [deg],inner [deg]\n0,0,5\n1,2,6\n")
    with pytest.raises(
        LogError, match=r"several columns of angles move \(outer, inner\); set \[table\] column"
    ):
        read_table(path, RIG)
    log = read_table(path, rig_from_dict({"table": {"column": "inner", "time_offset": 0.5}}))
    np.testing.assert_allclose(log.angle, np.array([5, 6]) * DEG, rtol=1e-15)
    np.testing.assert_array_equal(log.time, [0.5, 1.5])


@given(
    st.floats(-1e4, 1e4),
    st.sampled_from([-1, 1]),
    st.sampled_from(["0 to 360", "-180 to 180"]),
    st.floats(0.0, 5000.0),  # deg/s at 50 Hz: 100 deg between records, under half a turn
)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_wrapped_angle_is_unwrapped_whatever_the_start_and_sense(
    tmp_path, start, sense, range_, rate
):
    true = start + sense * rate * np.arange(120) * 0.02
    wrapped = true % 360 if range_ == "0 to 360" else (true + 180) % 360 - 180
    path = tmp_path / "table.csv"
    write_columns(path, {"time": np.arange(120) * 0.02, "angle [deg]": wrapped})
    log = read_table(path, rig_from_dict({"table": {"direction": sense}}))
    turned = log.angle - log.angle[0]
    # 1e4 deg wrapped in float64 keep 2e-12 deg; after 12,000 deg turned 4e-12.
    np.testing.assert_allclose(turned, rate * np.arange(120) * 0.02 * DEG, atol=1e-12)


def test_angle_that_counts_on_is_left_alone_across_a_drop_out(tmp_path):
    time = np.delete(np.arange(1000) * 0.02, np.s_[300:500])  # 4 s lost at 100 deg/s: 400 deg
    path = tmp_path / "table.csv"
    write_columns(path, {"time": time, "angle [deg]": 100 * time})
    np.testing.assert_allclose(read_table(path, RIG).angle, 100 * time * DEG, rtol=1e-14)


def test_reference_takes_the_columns_that_are_there(tmp_path):
    path = put(tmp_path, b"time [s],latitude [deg],v_east [m/s],note\n0,45,1,a\n1,46,2,b\n")
    log = read_reference(path)
    assert list(log.values) == ["latitude", "v_east"]
    np.testing.assert_allclose(log.values["latitude"], np.array([45, 46]) * DEG, rtol=1e-15)
    with pytest.raises(LogError, match="no reference column; at least one of latitude"):
        read_reference(put(tmp_path, b"time,a\n0,1\n1,2\n"))
