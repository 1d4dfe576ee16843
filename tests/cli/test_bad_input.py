"""Bad input: exit 1, one line that says where, what and what to do; nothing left behind.

Each fault of the logs themselves has its test in tests/logs; here they pass through the complete
command, an older result at hand.
"""

import json
import re

import pyarrow.parquet as pq
import pytest

from tests.conftest import FIXTURES

OLDER = '{"older": "result"}'


@pytest.fixture
def refused(rotcli, still):
    """Return a function that runs a command that must fail, and returns its one line."""

    def run(command, *args, status=1):
        target = still / "result.json"
        target.write_text(OLDER)
        before = sorted(still.rglob("*"))
        outcome = rotcli(command, *args, "-o", target)
        assert outcome.status == status, outcome
        assert outcome.out == ""
        lines = [line for line in outcome.err.splitlines() if "warning" not in line]
        if status == 1:
            assert len(lines) == 1, outcome.err
            assert lines[0].startswith("rotcli: error: ")
            assert "Traceback" not in outcome.err
        assert target.read_text() == OLDER
        assert sorted(still.rglob("*")) == before
        return outcome.err

    return run


def _edit(path, row, change):
    lines = path.read_text().splitlines()
    lines[row - 1] = change(lines[row - 1])
    path.write_text("\n".join(line for line in lines if line is not None) + "\n")


def _cell(column, value):
    def change(line):
        cells = line.split(",")
        cells[column] = value
        return ",".join(cells)

    return change


FAULTS = {
    "text": (lambda p: _edit(p, 30, _cell(2, "oops")), r"row 30: gyro_y: 'oops' is not a number"),
    "empty": (lambda p: _edit(p, 30, _cell(4, "")), r"row 30: accel_x: an empty cell"),
    "nan": (lambda p: _edit(p, 30, _cell(1, "nan")), r"row 30: gyro_x: nan is not a finite"),
    "inf": (lambda p: _edit(p, 30, _cell(6, "-inf")), r"row 30: accel_z: -inf is not a finite"),
    "ragged": (lambda p: _edit(p, 30, lambda line: line + ",7"), r"row 30: 8 values, the header"),
    "cut": (lambda p: _edit(p, 30, lambda line: line[:20]), r"row 30: \d values, the header"),
    "back": (lambda p: _edit(p, 30, _cell(0, "0.05")), r"row 30: time: .*goes back"),
    "missing": (
        lambda p: _edit(p, 1, lambda h: h.replace("gyro_y", "gyro_b")),
        r"no column gyro_y .the log has: time",
    ),
    "unit": (
        lambda p: _edit(p, 1, lambda h: h.replace("gyro_y [rad/s]", "gyro_y [furlong]")),
        r"gyro_y .*: unknown unit 'furlong'; set",
    ),
    "header only": (lambda p: _edit_all(p, lambda lines: lines[:1]), r"no data rows"),
    "empty file": (lambda p: p.write_bytes(b""), r"empty"),
    "rubbish": (lambda p: p.write_bytes(bytes(range(256)) * 40), r"imu\.csv: "),
    "long gap": (
        lambda p: _edit_all(p, lambda lines: lines[:100] + lines[140:]),
        r"row 101: time: 40 samples missing .* allow longer gaps",
    ),
}


def _edit_all(path, change):
    path.write_text("\n".join(change(path.read_text().splitlines())) + "\n")


@pytest.mark.parametrize("fault", FAULTS)
def test_a_faulty_cell_or_row_is_named(fault, refused, still):
    damage, expected = FAULTS[fault]
    damage(still / "imu.csv")
    line = refused("navigate", still / "imu.csv", still / "table.csv")
    assert f"{still}/imu.csv: " in line
    assert re.search(expected, line), line


def test_a_short_gap_is_bridged_and_reported_and_a_long_one_may_be_allowed(rotcli, still):
    _edit_all(still / "imu.csv", lambda lines: lines[:1000] + lines[1003:])
    outcome = rotcli("navigate", still / "imu.csv", "-o", still / "n.json")
    assert outcome.status == 0
    assert "1 gap (3 samples)" in outcome.err
    assert any("interpolated" in w for w in json.loads((still / "n.json").read_text())["warnings"])
    _edit_all(still / "imu.csv", lambda lines: lines[:1200] + lines[1240:])
    assert rotcli("navigate", still / "imu.csv", "--max-gap", "40", "-o", "-").status == 0


def test_a_missing_or_truncated_file_is_named(refused, turning):
    line = refused("calibrate", turning / "nowhere.parquet", turning / "table.parquet")
    assert "nowhere.parquet: " in line
    log = turning / "imu.parquet"
    log.write_bytes(log.read_bytes()[:-200])
    assert "imu.parquet: " in refused("calibrate", log, turning / "table.parquet")


def test_swapped_logs_are_recognised(refused, turning):
    line = refused("calibrate", turning / "table.parquet", turning / "imu.parquet")
    assert "is the order IMU_LOG TABLE_LOG swapped?" in line


def test_one_file_for_both_logs_is_recognised(refused, turning):
    line = refused("calibrate", turning / "imu.parquet", turning / "imu.parquet")
    assert "the IMU log and the table log are the same file, and it is an IMU log" in line


def _rewrite(path, change):
    table = pq.read_table(path)
    pq.write_table(change(table), path)


def test_a_table_log_that_ends_early_is_refused(refused, turning):
    _rewrite(turning / "table.parquet", lambda t: t.slice(0, 1200))
    line = refused("navigate", turning / "imu.parquet", turning / "table.parquet")
    assert "segment 21 to 31 s is outside the time of the logs (0 to 23.98 s)" in line
    assert "--window" in line


def test_a_table_that_never_turns_cannot_calibrate(refused, still):
    line = refused("calibrate", still / "imu.csv", still / "table.csv")
    assert "no turning segment of 5 s at constant rate" in line
    assert "table.csv: " in line


@pytest.mark.parametrize("command", ["calibrate", "navigate"])
def test_a_table_that_turns_the_other_way_is_refused(refused, turning, command):
    rig = turning / "rig.toml"
    rig.write_text(rig.read_text().replace("direction = 1", "direction = -1"))
    line = refused(command, turning / "imu.parquet", turning / "table.parquet")
    assert "opposite sense; set [table] direction" in line


def test_a_table_log_on_another_clock_cannot_calibrate(rotcli, refused, turning):
    rig = turning / "rig.toml"
    rig.write_text(rig.read_text().replace("time_offset = 0.0", "time_offset = 0.3"))
    line = refused("calibrate", turning / "imu.parquet", turning / "table.parquet")
    assert re.search(r"the gyro log leads the table log by (299|300)\.\d+ ms", line), line
    offset = float(line.split("set [table] time_offset = ")[1].split()[0])
    assert abs(offset) < 0.001
    rig.write_text(rig.read_text().replace("time_offset = 0.3", f"time_offset = {offset}"))
    found = rotcli("calibrate", turning / "imu.parquet", turning / "table.parquet")
    assert (found.status, "the table by" in found.err) == (0, False)


def test_a_small_lag_is_reported_and_kept_in_the_result(rotcli, turning):
    rig = turning / "rig.toml"
    rig.write_text(rig.read_text().replace("time_offset = 0.0", "time_offset = -0.012"))
    found = rotcli("calibrate", turning / "imu.parquet", turning / "table.parquet", "-o", "-")
    assert found.status == 0
    assert "the gyro log lags the table log by 1" in str(json.loads(found.out)["warnings"])


def test_a_still_segment_that_moves_is_refused(refused, turning):
    logs = (turning / "imu.parquet", turning / "table.parquet")
    line = refused("calibrate", *logs, "--static", "5:12")
    assert re.search(r"table\.parquet: .*still", line), line
    # Without a table log only the gyros can show it.
    line = refused("navigate", logs[0], "--mode", "conventional", "--static", "5:12")
    assert "is not still" in line


def test_a_turning_log_without_its_table_log_is_refused(refused, turning):
    line = refused("navigate", turning / "imu.parquet", "--static", "0:8")
    assert re.search(r"the gyros read \(.*, 60\.\d+\) deg/s from 21 s on", line), line
    assert "but there is no table log; add it" in line


def test_a_named_segment_that_reaches_into_the_ramp_is_reported(rotcli, turning):
    logs = (turning / "imu.parquet", turning / "table.parquet")
    found = rotcli("calibrate", *logs, "--static", "0:9.3")
    assert found.status == 0
    assert re.search(r"only 0 to (7\.9.*|8) s of the segment 0 to 9.3 s is used", found.err)
    doc = rotcli(
        "navigate", logs[0], logs[1], "--static", "0:9.3", "--mode", "conventional", "-o", "-"
    )
    assert "of the segment 0 to 9.3 s is used" in str(json.loads(doc.out)["warnings"])


def test_a_still_segment_of_no_use_is_reported(rotcli, turning):
    path = _calibration(rotcli, turning)
    logs = (turning / "imu.parquet", turning / "table.parquet", "--calibration", path)
    found = rotcli("navigate", *logs, "--static", "0:5")
    assert "the named still segment has no effect: full takes the calibration's biases" in found.err
    assert "--static" not in rotcli("navigate", *logs).err


def test_clipped_samples_are_reported(rotcli, turning):
    rig = turning / "rig.toml"
    rig.write_text(rig.read_text().replace("gyro_range = 400.0", "gyro_range = 60.0"))
    outcome = rotcli("calibrate", turning / "imu.parquet", turning / "table.parquet")
    assert outcome.status == 1
    assert re.search(r"is rejected: .* samples of gyro_z are clipped at gyro_range", outcome.err)


RIGS = {
    "not TOML": ("[site\n", r"rig\.toml: line 1, .*not TOML"),
    "unknown key": ("[imu]\nangle_random_wlak = 3\n", r"similar: angle_random_walk"),
    "impossible": ("[site]\nlatitude = 95\n", r"\[site\] latitude: 95 is out of range; allowed"),
    "wrong type": ("[table]\naxis = 7\n", r"\[table\] axis: 7 "),
}


@pytest.mark.parametrize("fault", RIGS)
def test_a_faulty_rig_is_named(fault, refused, still):
    text, expected = RIGS[fault]
    (still / "rig.toml").write_text(text)
    line = refused("navigate", still / "imu.csv")
    assert re.search(expected, line), line


def _calibration(rotcli, folder):
    path = folder / "c.json"
    args = (folder / "imu.parquet", folder / "table.parquet", "-o", path)
    assert rotcli("calibrate", *args).status == 0
    return path


def test_a_calibration_of_another_rate_is_refused_unless_allowed(rotcli, refused, turning):
    path = _calibration(rotcli, turning)
    doc = json.loads(path.read_text())
    for segment in doc["segments"]:
        segment["rate_dps"] *= 0.5
    path.write_text(json.dumps(doc))
    logs = (turning / "imu.parquet", turning / "table.parquet", "--calibration", path)
    line = refused("navigate", *logs)
    assert re.search(r"c\.json: made at 30 deg/s, but .* turns at 60 deg/s; calibrate at", line)
    allowed = rotcli("navigate", *logs, "--allow-other-rate", "-o", "-")
    assert allowed.status == 0
    assert any("made at 30 deg/s" in w for w in json.loads(allowed.out)["warnings"])


def test_a_calibration_of_another_axis_is_refused(rotcli, refused, turning):
    path = _calibration(rotcli, turning)
    doc = json.loads(path.read_text())
    doc["axis"] = "x"
    names = {"Kgxz": "Kgx", "Kgyz": "Kgyx", "Kgz": "Kgzx"}
    doc["parameters"] = {names.get(n, n): q for n, q in doc["parameters"].items()}
    doc["covariance"]["order"] = [names.get(n, n) for n in doc["covariance"]["order"]]
    path.write_text(json.dumps(doc))
    logs = (turning / "imu.parquet", turning / "table.parquet", "--calibration", path)
    assert "made turning about x, but the rig turns about z" in refused("navigate", *logs)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("{", "not a result file"),
        ("[1, 2]", "it has no kind"),
        ('{"kind": "calibration", "schema": 99}', "schema 99 is not known"),
        ('{"kind": "navigation", "schema": 1}', "a calibration is needed"),
        ('{"kind": "calibration", "schema": 1, "axis": "q"}', 'axis: "q": cannot be'),
        ('{"kind": "calibration", "schema": 1, "axis": "z"}', "parameters: missing"),
        (
            '{"kind": "calibration", "schema": 1, "axis": "z", "parameters": {"bias_x": {}}}',
            "parameters.bias_x: {}: must contain",
        ),
        (
            '{"kind": "calibration", "schema": 1, "axis": "z", "segments": 5, "parameters": {}}',
            "segments: 5: must be array",
        ),
    ],
)
def test_a_file_that_is_no_calibration_is_refused(refused, turning, content, expected):
    path = turning / "c.json"
    path.write_text(content)
    logs = (turning / "imu.parquet", turning / "table.parquet", "--calibration", path)
    line = refused("navigate", *logs)
    assert f"{path}: " in line
    assert expected in line


def test_biases_alone_do_not_make_a_full_calibration(rotcli, refused, turning):
    path = _calibration(rotcli, turning)
    doc = json.loads(path.read_text())
    for name in ("Kgxz", "Kgyz", "Kgz"):
        del doc["parameters"][name]
    del doc["covariance"]
    path.write_text(json.dumps(doc))
    logs = (turning / "imu.parquet", turning / "table.parquet", "--calibration", path)
    assert "contains biases but no scale factor" in refused("navigate", *logs, "--mode", "full")
    assert rotcli("navigate", *logs, "--mode", "partial").status == 0


@pytest.mark.parametrize("option", ["-o", "--solution", "--plot"])
def test_an_output_that_cannot_be_written_is_named(rotcli, still, option):
    suffix = {"-o": "json", "--solution": "parquet", "--plot": "png"}[option]
    target = still / "no" / "such" / f"folder.{suffix}"
    outcome = rotcli("navigate", still / "imu.csv", option, target)
    assert outcome.status == 1
    assert f"{target}: cannot be written" in outcome.err
    assert len([line for line in outcome.err.splitlines() if "error" in line]) == 1
    folder = rotcli("navigate", still / "imu.csv", "-o", still)
    assert folder.status == 1
    assert "cannot be written: Is a directory" in folder.err


def test_a_window_outside_the_log_is_refused(refused, still):
    line = refused("navigate", still / "imu.csv", "--window", "100:200")
    assert "is outside" in line
    assert "100 to 200 s" in line


@pytest.mark.parametrize(
    ("args", "expected"),
    [
        (["--mode", "full"], "need --calibration"),
        (["--window", "10"], "is not START:END"),
        (["--window", "10:5"], "start before end"),
        (["--mode", "fast"], "'fast' is not one of"),
        (["--max-gap", "-1"], "--max-gap"),
    ],
)
def test_a_wrong_command_line_exits_with_2(refused, still, args, expected):
    assert expected in refused("navigate", still / "imu.csv", *args, status=2)


def test_the_fixtures_were_not_touched():
    assert sorted(p.name for p in (FIXTURES / "nav440_still").iterdir()) == [
        "imu.csv",
        "rig.toml",
        "table.csv",
        "truth.json",
    ]
