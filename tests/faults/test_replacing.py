"""No output replaces an input, a recording or another output."""

import pytest


def linked(link, target):
    link.unlink(missing_ok=True)
    link.symlink_to(target)
    return link


OUTPUTS = {
    "calibrate": (["{imu}", "{table}"], ["-o", "--report-residuals"]),
    "navigate": (["{imu}", "{table}"], ["-o", "--solution", "--plot"]),
    "observe": (["{imu}", "{table}"], ["-o", "--solution", "--plot", "--save-calibration"]),
    "allan": (["{imu}"], ["-o", "--plot"]),
    "convert": (["{imu}"], ["-o"]),
}


@pytest.mark.parametrize("command", OUTPUTS)
def test_an_output_that_is_an_input_is_refused(command, rotcli, turning, tmp_path):
    arguments, options = OUTPUTS[command]
    logs = {"imu": turning / "imu.parquet", "table": turning / "table.parquet"}
    link = tmp_path / "link.parquet"
    link.symlink_to(logs["imu"])
    before = {p: p.read_bytes() for p in turning.iterdir()}
    for option in options:
        for target in (logs["imu"], link, turning / ".." / "turning" / "rig.toml"):
            if option == "-o" and command != "convert":  # another suffix is refused as such
                target = linked(tmp_path / f"{target.stem}.json", target)
            if option == "--plot":
                target = linked(tmp_path / f"{target.stem}.png", target)
            args = [a.format(**logs) for a in arguments]
            done = rotcli(command, *args, option, target)
            assert done.status == 2, done
            assert "would replace the input" in done.err
    assert {p: p.read_bytes() for p in turning.iterdir()} == before


def test_a_voyage_keeps_its_inputs_its_folder_and_its_limits(rotcli, tmp_path):
    scenario = tmp_path / "scenario.toml"
    scenario.write_text("scenario = 'srins'\nduration = 0.6\nrate = 5.0\n")
    assert (
        "would replace the input"
        in rotcli("srins", "simulate", "--scenario", scenario, "-o", tmp_path).err
    )
    own = tmp_path / "own"
    own.mkdir()
    (own / "gnss.parquet").write_text("a day at sea")
    done = rotcli("srins", "simulate", "--scenario", scenario, "-o", own)
    assert (done.status, "is there and not of a simulation" in done.err) == (1, True)
    sea = tmp_path / "sea"
    for _ in range(2):  # a simulation replaces an earlier one
        assert rotcli("srins", "simulate", "--scenario", scenario, "-o", sea).status == 0
    logs = {name: sea / f"{name}.parquet" for name in ("imu", "table", "gnss", "doppler")}
    line = ["srins", "calibrate", logs["imu"], logs["table"], "--settle", "0.3"]
    line += ["--reference", logs["gnss"], "--speed", logs["doppler"]]
    before = {p: p.read_bytes() for p in sea.iterdir()}
    for option in ("-o", "--solution", "--plot"):
        for name in (*logs.values(), sea / "rig.toml"):
            done = rotcli(*line, option, name)
            # Another suffix is not that of a result, which is checked first.
            other = (
                "this command writes JSON" in done.err or "not the name of a picture" in done.err
            )
            said = other or "would replace the input" in done.err
            assert (done.status, said) == (2, True)
    assert (
        "would replace"
        in rotcli(*line, "--truth", sea / "truth.json", "-o", sea / "truth.json").err
    )
    rig = sea / "rig.toml"
    assert rotcli("srins", "observe", "--rig", rig, "-o", rig).status == 2
    assert {p: p.read_bytes() for p in sea.iterdir()} == before
    for name in ("table", "gnss", "doppler", "imu"):
        size = str(logs[name].stat().st_size // 2)
        assert "raise the limit (option: --max-bytes)" in rotcli(*line, "--max-bytes", size).err
    bad = tmp_path / "bad.json"
    bad.write_text('{"kind": "simulation", "schema": 1, "sensor_errors": {"gyro_bias_x": [1]}}')
    assert "gyro_bias_x: [1] is not a number" in rotcli(*line, "--truth", bad).err


def test_two_outputs_in_one_file_and_a_report_over_its_result_are_refused(rotcli, turning):
    logs = (turning / "imu.parquet", turning / "table.parquet")
    same = turning / "same.json"
    done = rotcli("calibrate", *logs, "-o", same, "--report-residuals", same)
    assert "would replace the output of -o" in done.err
    rig = turning / "rig.toml"
    same_rig = linked(turning / "same_rig.json", rig)
    assert "would replace the input" in rotcli("budget", "--rig", rig, "-o", same_rig).err
    result = turning / "r.md"
    result.write_text("{}")
    assert "would replace the input" in rotcli("report", result, "-o", result).err


def test_a_simulation_does_not_replace_a_recording(rotcli, tmp_path):
    log = tmp_path / "imu.parquet"
    log.write_text("a day at the table")
    line = ["simulate", "--imu", "nav440", "--rate", "10", "--static", "2", "--rotation", "2"]
    line += ["--navigation", "0", "-o", tmp_path]
    done = rotcli(*line)
    assert done.status == 1
    assert "is there and not of a simulation" in done.err
    assert log.read_text() == "a day at the table"
    log.unlink()
    assert rotcli(*line).status == 0
    assert rotcli(*line).status == 0  # an earlier simulation is replaced
    scenario = tmp_path / "rig.toml"
    assert rotcli("simulate", "--scenario", scenario, "-o", tmp_path).status == 2
