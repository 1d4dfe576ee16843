import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rotcli.errors import RigError
from rotcli.rig.rig import Rig, default_rig, read_rig, rig_from_dict

# The example of the file format, word for word.
EXAMPLE = """
[site]
latitude  = 51.08        # deg
longitude = -114.13      # deg
height    = 1100.0       # m

[attitude]
pitch = 0.0
roll = 0.0
azimuth = 0.0

[imu]
name = "NAV440"
sampling = "instant"
angle_random_walk = 0.4        # deg/sqrt(h)
bias_instability = 11.0        # deg/h
velocity_random_walk = 0.05    # m/s/sqrt(h)
gyro_range = 400.0
mount = [[1,0,0],[0,1,0],[0,0,1]]
lever_arm = [0.0, 0.0, 0.0]
columns = { gyro_x = "Gyr_X", accel_x = "Acc_X" }
units = { gyro = "deg/s", accel = "g" }

[table]
axis = "z"
direction = 1
column = "angle"
units = "deg"
time_offset = 0.0

[stages]
static = [0, 60]
rotation = [60, 120]
navigation = [120, 420]
"""


def read(tmp_path, text):
    path = tmp_path / "rig.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_rig(path)


def test_example_is_read_into_si(tmp_path):
    rig = read(tmp_path, EXAMPLE)
    assert rig.site is not None
    assert rig.site.latitude == math.radians(51.08)
    assert rig.site.gravity is None
    # 0.4 deg/sqrt(h) = 0.4 / 60 deg/sqrt(s); 11 deg/h; 0.05 / 60 m/s/sqrt(s)
    assert rig.imu.angle_random_walk == pytest.approx(math.radians(0.4 / 60), rel=1e-15)
    assert rig.imu.bias_instability == pytest.approx(math.radians(11) / 3600, rel=1e-15)
    assert rig.imu.velocity_random_walk == pytest.approx(0.05 / 60, rel=1e-15)
    assert rig.imu.gyro_range == pytest.approx(math.radians(400), rel=1e-15)
    assert rig.table.axis_name == "z"
    assert rig.stages.rotation == ((60.0, 120.0),)
    assert rig.stages.navigation == (120.0, 420.0)


def test_effective_rig_goes_through_json_and_comes_back_equal(tmp_path):
    rig = read(tmp_path, EXAMPLE)
    loaded = rig.effective()
    assert loaded["site"] == {"latitude": 51.08, "longitude": -114.13, "height": 1100.0}
    assert loaded["imu"]["angle_random_walk"] == 0.4
    assert list(loaded) == ["site", "attitude", "imu", "table", "stages"]
    assert rig_from_dict(json.loads(json.dumps(loaded)), rig.path) == rig


@given(
    st.floats(-90, 90),
    st.floats(0, 1e4),
    st.lists(st.floats(-1, 1), min_size=3, max_size=3).filter(lambda v: np.linalg.norm(v) > 1e-3),
)
def test_any_rig_comes_back_equal(latitude, noise, axis):
    given_rig = {"site": {"latitude": latitude}, "table": {"axis": axis}}
    given_rig["imu"] = {"angle_random_walk": [noise, noise / 3, 0.0], "rate_random_walk": noise}
    rig = rig_from_dict(given_rig)
    again = rig_from_dict(json.loads(json.dumps(rig.effective())))
    assert again == rig


def test_default_rig_comes_back_equal():
    assert rig_from_dict(default_rig().effective()) == default_rig()
    assert default_rig() != default_rig().override({"table": {"direction": -1}})


def test_one_pair_or_several_name_the_rotation(tmp_path):
    assert read(tmp_path, "[stages]\nrotation=[[1,2],[3,4]]").stages.rotation == ((1, 2), (3, 4))


def test_axis_is_normalised_and_named():
    rig = rig_from_dict({"table": {"axis": [0, 3, 4]}})
    np.testing.assert_allclose(rig.table.axis, [0, 0.6, 0.8], rtol=1e-15)
    assert rig.table.axis_name == "u"
    assert rig_from_dict({"table": {"axis": [0, 2, 0]}}).table.axis_name == "y"


def test_lever_arm_is_offered_in_the_sensor_frame():
    # The IMU's x axis lies along y of the mounting frame: 1 m along x is 1 m along y.
    rig = rig_from_dict(
        {"imu": {"mount": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], "lever_arm": [1, 0, 0]}}
    )
    np.testing.assert_array_equal(rig.lever_arm_s, [0, 1, 0])


def test_figures_hold_one_number_or_three():
    rig = rig_from_dict({"imu": {"angle_random_walk": 60, "bias_instability": [3600, 0, 0]}})
    np.testing.assert_allclose(rig.imu.figure("angle_random_walk"), 3 * [math.radians(1)])
    np.testing.assert_allclose(rig.imu.figure("bias_instability"), [math.radians(1), 0, 0])
    assert rig.imu.figure("rate_random_walk") is None


def test_override_takes_the_files_own_units_and_keeps_the_rest():
    rig = rig_from_dict({"site": {"latitude": 10.0}}).override(
        {"stages": {"static": [0, 5]}, "attitude": {"pitch": 30.0}}
    )
    assert rig.attitude.pitch == math.radians(30)
    assert rig.site == rig_from_dict({"site": {"latitude": 10.0}}).site
    assert rig.stages.static == (0.0, 5.0)


@pytest.mark.parametrize(
    "table",
    [
        {"units": "deg"},
        {"units": {"time": "ns", "angle": "deg"}, "columns": {"time": "Stamp", "angle": "Winkel"}},
        {"units": {"time": "ns"}, "column": "Winkel", "columns": {"time": "Stamp"}},
    ],
)
def test_the_tables_columns_and_units_come_back_as_they_were_written(table):
    rig = rig_from_dict({"table": table})
    assert rig.table.units.get("angle") == ("deg" if "deg" in str(table) else None)
    assert rig.table.column == ("Winkel" if "Winkel" in str(table) else "angle")
    back = rig.effective()
    assert {**back["table"], **table} == back["table"]
    assert rig_from_dict(back) == rig


def test_byte_order_mark_is_tolerated(tmp_path):
    assert read(tmp_path, b"\xef\xbb\xbf[site]\r\nlatitude = 1\r\n").site is not None


FAULTS = {
    "[imu]\nangle_random_wlak=1": r"\[imu\] angle_random_wlak: unknown key; similar: angle_random",
    "[imu]\nzzz=1": r"zzz: unknown key; known: name, sampling",
    "[imuu]\nname='a'": r"imuu: unknown section; similar: imu",
    "latitude = 3": r"latitude: unknown key; it belongs in \[site\]",
    "imu = 3": r"imu: not a section; write it as \[imu\]",
    "[site]\nlatitude=95": r"\[site\] latitude: 95 is out of range; allowed: -90 to 90 deg",
    "[site]\nlongitude=5": r"\[site\] latitude: missing",
    "[site]\nlatitude=nan": r"latitude: nan is not finite",
    f"[site]\nlatitude=1{'0' * 400}": r"latitude: 1000.* is not finite",
    "[site]\nlatitude='5'": r"latitude: '5' is not a number; allowed: -90 to 90 deg",
    "[site]\nlatitude=true": r"latitude: true is not a number",
    "[imu]\nangle_random_walk=-1": r"-1 is out of range; allowed: 0 to 10000 deg/sqrt\(h\)",
    "[imu]\nangle_random_walk=[1,2]": r"\[1, 2\] is not a list of 3 numbers",
    "[imu]\ngyro_range=0": r"gyro_range: 0 is out of range; allowed: above 0, at most 100000 deg/s",
    "[imu]\nsampling='both'": r"'both' is not allowed; allowed: instant, average, increment",
    "[imu]\nname=3": r"name: 3 is not a text",
    "[imu]\nlever_arm=[1,2]": r"lever_arm: \[1, 2\] is not a list of 3 numbers",
    "[imu]\nmount=[[1,0,0],[0,1,0]]": r"not three rows of three numbers",
    "[imu]\nmount=[[1,0,0],[0,1,0],[0,0.1,1]]": r"not orthogonal unit vectors \(deviation 0.1\)",
    "[imu]\nmount=[[1,0,0],[0,1,0],[0,0,-1]]": r"reflection .*check its signs.*reports_gravity",
    "[imu]\ncolumns='a'": r"columns: 'a' is not a table such as",
    "[imu]\ncolumns={gyrox='a'}": r"columns: gyrox: unknown key; similar: gyro_x",
    "[imu]\ncolumns={gyro_x=0}": r"columns: gyro_x: 0 is not a column name in quotes",
    "[imu]\ncolumns={gyro_x=1.5}": r"gyro_x: 1.5 is not a column name in quotes",
    "[imu]\ncolumns={gyro_x=2,gyro_y=2}": r"names one column of the log twice",
    "[imu]\nformat='xsense'": r"format: 'xsense' is not a known format; similar: xsens",
    "[imu]\ndelimiter='tab'": r"delimiter: 'tab' is not a delimiter; write one sign",
    "[imu]\nskip=-1": r"skip: -1 is out of range; allowed: 0 to 100000",
    "[imu]\ncolumns={gyro_x='a',gyro_y='a'}": r"names one column of the log twice",
    "[imu]\nunits={gyro='furlong'}": r"gyro: 'furlong' is not a known unit; known: rad/s, deg/s",
    "[table]\ndirection=2": r"direction: 2 is not allowed; allowed: 1, -1",
    "[table]\ndirection=true": r"direction: true is not allowed",
    "[table]\naxis='w'": r"axis: 'w' is not allowed; allowed: x, y, z or a list of 3 numbers",
    "[table]\naxis=[0,0,0]": r"axis: \[0, 0, 0\] has no direction",
    "[table]\naxis=[0,1]": r"axis: .*not a list of 3 numbers; allowed: x, y, z",
    "[table]\nunits='furlong'": r"'furlong' is not a known unit; known: rad, deg",
    "[table]\nunits=5": r"units: 5 is not a unit in quotes; write units = \"deg\" or units = \{ ti",
    "[table]\nunits={angle='s'}": r"units: angle: 's' is not a known unit; known: rad, deg",
    "[table]\nunits={gyro='deg/s'}": r"units: gyro: unknown key; known: time, angle, rate",
    "[table]\ncolumn={time='Stamp'}": (
        r"column: \{ time = 'Stamp' \} is not a column name in quotes; write columns = \{ time = "
    ),
    "[table]\ncolumns='Winkel'": r"columns: 'Winkel' is not a table such as \{ time = \"…\" \}",
    "[table]\ncolumns={angle=true}": r"columns: angle: true is not a column name",
    "[table]\ncolumns={angle='a'}\ncolumn='b'": (
        r"\[table\] column: 'b', but columns names 'a'; remove one of them"
    ),
    "[table]\ncolumns={time='a',angle='a'}": (
        r"\{ time = 'a', angle = 'a' \} names one column of the log twice"
    ),
    "[table]\ntime_offset=inf": r"time_offset: inf is not finite; allowed: -1e\+10 to 1e\+10 s",
    "[stages]\nstatic=[60,0]": r"static: \[60, 0\] ends before it starts",
    "[stages]\nstatic=[60]": r"static: \[60\] is not a list of 2 numbers",
    "[stages]\nrotation=[]": r"rotation: \[\] is not \[start, end\] nor a list",
    "[site]\nlatitude = = 3": r"rig.toml: line 2, column 12: not TOML",
    b"[imu]\nname='\xff'": r"rig.toml: not UTF-8 text \(byte 12\)",
}


@pytest.mark.parametrize("text", FAULTS)
def test_faulty_rig_is_reported_in_one_line(tmp_path, text):
    with pytest.raises(RigError, match=FAULTS[text]) as caught:
        read(tmp_path, text)
    message = str(caught.value)
    assert message.startswith(str(tmp_path / "rig.toml"))
    assert "\n" not in message
    assert len(message) < (800 if "known: name" in message else 300)


def test_missing_rig_is_reported(tmp_path):
    with pytest.raises(RigError, match="cannot be read: No such file"):
        read_rig(tmp_path / "none.toml")


def test_default_rig_turns_about_z():
    assert Rig().table.axis_name == "z"
