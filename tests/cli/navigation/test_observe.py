"""`rotcli observe` on small files: exit status, messages, what is written."""

import json

import numpy as np
import pytest

from rotcli.cli.main import main
from tests.cli.navigation.observe_runs import logs, rotcli


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Folder of a simulated log: y axis at pitch 30, 60 s at 10 deg/s."""
    folder = tmp_path_factory.mktemp("observe")
    with pytest.raises(SystemExit) as stop:
        main(
            f"simulate --imu mti-g --axis y --pitch 30 --rate 10 --static 20 --rotation 20 "
            f"--navigation 60 --quiet -o {folder}".split()
        )
    assert stop.value.code == 0
    return folder


def test_a_log_gives_the_analysis_and_the_filter_in_one_document(capsys, run, tmp_path):
    output, plot, series = (tmp_path / n for n in ("o.json", "o.svg", "s.parquet"))
    status, out, err = rotcli(
        capsys, "observe", *logs(run), "-o", output, "--plot", plot, "--solution", series
    )
    assert (status, out) == (0, "")
    assert "o.json: ZUPT filter estimates, about y at 10 deg/s (rank 11 of 12)" in err
    doc = json.loads(output.read_text())
    assert doc["rank"] == 11
    assert doc["inputs"][0]["rows"] > 10000
    found = doc["filter"]
    truth = json.loads((run / "truth.json").read_text())
    for k, axis in enumerate("xyz"):
        for name, true, unit in (
            (f"gyro_bias_{axis}", truth["gyro"]["bias_dph"][k], "deg/h"),
            (f"accel_bias_{axis}", truth["accel"]["bias_mps2"][k], "m/s^2"),
        ):
            q = found["estimates"][name]
            assert set(q) == {"value", "sigma", "unit"}
            assert q["unit"] == unit
            assert abs(q["value"] - true) < 4.0 * q["sigma"]
    assert {"tilt_east", "tilt_north", "azimuth"} < set(found["estimates"])
    assert {"roll_deg", "pitch_deg", "azimuth_deg", "gyro_bias_x"} < set(found["rms"])
    assert found["consistency"]["verdict"] == "consistent"
    assert "azimuth" in found["not_to_be_used"]
    assert not {"gyro_bias_x", "accel_bias_y", "tilt_east"} & set(found["not_to_be_used"])
    assert plot.read_text().lstrip().startswith("<?xml")

    table = read_parquet(series)
    assert {"time [s]", "gyro_bias_z [deg/h]", "sigma_gyro_bias_z [deg/h]", "nis"} < set(
        table.column_names
    )
    last = table["gyro_bias_z [deg/h]"].to_numpy()[-1]
    assert last == pytest.approx(found["estimates"]["gyro_bias_z"]["value"], rel=1e-12)


def read_parquet(path):
    import pyarrow.parquet

    return pyarrow.parquet.read_table(path)


@pytest.mark.parametrize("extra", [(), ("--smooth",)])
def test_the_series_of_a_tilted_table_is_that_of_the_second_pass(capsys, run, tmp_path, extra):
    output, series = tmp_path / "o.json", tmp_path / "s.parquet"
    tilted = ("--pitch", "31", "--solution", series, "-o", output, *extra)
    status, _, err = rotcli(capsys, "observe", *logs(run), *tilted)
    assert status == 0, err
    assert "1 deg off [attitude]; the estimated attitude is used; correct [attitude]" in err
    table = read_parquet(series)
    found = json.loads(output.read_text())["filter"]["estimates"]
    assert len(table) == int(np.rint((table["time [s]"].to_numpy()[-1]) / 0.1))  # one pass
    for name, unit in (("tilt_east", "deg"), ("gyro_bias_z", "deg/h")):
        last = table[f"{name} [{unit}]"].to_numpy()[-1]
        assert last == pytest.approx(found[name]["value"], rel=1e-12)
    assert found["tilt_east"]["value"] == pytest.approx(-1.0, abs=0.15)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["o.json", "s.parquet"]  # no drafts


def test_a_long_series_is_written_in_few_row_groups_and_a_pipe_is_given_it_once(
    capsys, run, tmp_path, monkeypatch
):
    import os
    import threading

    import pyarrow.parquet

    from rotcli.observe import zupt_files
    from rotcli.observe.zupt import passes

    monkeypatch.setattr(passes, "UPDATES", 50)
    monkeypatch.setattr(zupt_files, "CHUNK_SAMPLES", 200)
    series = tmp_path / "s.parquet"
    assert rotcli(capsys, "observe", *logs(run), "--quiet", "--solution", series)[0] == 0
    groups = pyarrow.parquet.ParquetFile(series).metadata
    assert groups.num_row_groups == -(-groups.num_rows // 200)
    pipe, got = tmp_path / "p.csv", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()))
    reader.start()
    given = ("--pitch", "31", "--quiet", "--solution", pipe)
    assert rotcli(capsys, "observe", *logs(run), *given)[0] == 0
    reader.join(10.0)
    assert len(got[0].splitlines()) == groups.num_rows + 1


def test_a_history_too_long_to_smooth_is_one_line_that_says_what_to_do(
    capsys, run, tmp_path, monkeypatch
):
    from rotcli.observe.zupt import prepare as stage

    monkeypatch.setattr(stage, "MAX_HISTORY_BYTES", 1e5)
    output = tmp_path / "o.json"
    status, out, err = rotcli(capsys, "observe", *logs(run), "--smooth", "-o", output)
    assert (status, out) == (1, "")
    assert "imu.parquet: the history of" in err
    assert "Hz at most, a shorter window, or omit smoothing (options: --update-rate" in err
    assert len(err.splitlines()) == 1
    assert not output.exists()


def test_calibrate_observe_and_navigate_work_on_each_others_files(capsys, run, tmp_path):
    calibration, saved, nav = (tmp_path / n for n in ("c.json", "saved.json", "nav.json"))
    assert rotcli(capsys, "calibrate", *logs(run), "-o", calibration, "--quiet")[0] == 0
    status, out, err = rotcli(
        capsys,
        *("observe", *logs(run), "--calibration", calibration, "--window", "30:90"),
        *("--save-calibration", saved, "--smooth", "-o", "-"),
    )
    assert status == 0
    assert "no calibration of the gyros" not in err
    doc = json.loads(out)
    assert doc["filter"]["settings"]["calibrated"]
    assert doc["filter"]["settings"]["smoothed"]
    assert "Kgy" not in doc["filter"]["estimates"]
    read = json.loads(saved.read_text())
    assert read["kind"] == "calibration"
    for ours, theirs in (("gyro_bias_x", "bias_x"), ("accel_bias_z", "accel_bias_z")):
        estimate, kept = doc["filter"]["estimates"][ours], read["parameters"][theirs]
        assert kept["unit"] == estimate["unit"]
        assert kept["value"] == pytest.approx(estimate["value"], rel=1e-12)
        assert kept["sigma"] == pytest.approx(estimate["sigma"], rel=1e-12)
    original = json.loads(calibration.read_text())["parameters"]["Kgy"]["value"]
    assert read["parameters"]["Kgy"]["value"] == pytest.approx(original)
    status, _, err = rotcli(
        capsys, "navigate", *logs(run), "--mode", "full", "--calibration", saved, "-o", nav
    )
    assert status == 0, err
    assert json.loads(nav.read_text())["rms"]["horizontal_m"] < 1000.0


def test_noise_figures_of_an_allan_result_are_used(capsys, run, tmp_path):
    allan = tmp_path / "allan.json"
    axis = {
        "coefficients": {"random_walk": {"value": 6.0, "sigma": None, "unit": "deg/sqrt(h)"}},
        "gauss_markov": {
            "sigma": {"value": 48.0, "sigma": None, "unit": "deg/h"},
            "correlation_time_s": 120.0,
        },
    }
    text = {"kind": "allan", "schema": 1, "axes": {f"gyro_{a}": axis for a in "xyz"}}
    allan.write_text(json.dumps(text))
    _, out, _ = rotcli(capsys, "observe", *logs(run), "--allan", allan, "-o", "-")
    used = json.loads(out)["filter"]["settings"]
    assert used["angle_random_walk"]["value"] == pytest.approx(6.0)
    assert used["gyro_wander"]["value"] == pytest.approx(48.0)
    assert used["velocity_random_walk"]["value"] == pytest.approx(0.12)  # the rig's

    # Flicker and walk count as in a rig; white noise alone shows nothing of slow noise.
    axis["coefficients"]["bias_instability"] = {"value": 8.0, "sigma": None, "unit": "deg/h"}
    walk = {"value": 0.5, "sigma": None, "unit": "deg/h/sqrt(s)"}
    axis["coefficients"]["rate_random_walk"] = walk
    axis["gauss_markov"] = {"sigma": None, "correlation_time_s": None, "reason": "too short"}
    allan.write_text(json.dumps(text))
    _, out, _ = rotcli(capsys, "observe", *logs(run), "--allan", allan, "-o", "-")
    used = json.loads(out)["filter"]["settings"]
    assert used["gyro_wander"]["value"] == pytest.approx(np.hypot(3.0 * 8.0, 0.5 * np.sqrt(60.0)))
    del axis["coefficients"]["bias_instability"], axis["coefficients"]["rate_random_walk"]
    allan.write_text(json.dumps(text))
    rig = tmp_path / "rig.toml"
    rig.write_text("[site]\nlatitude = 51.0\n[attitude]\npitch = 30\nroll = 0\nazimuth = 0\n"
                   '[table]\naxis = "y"\n')  # fmt: skip
    _, _, err = rotcli(capsys, "observe", *logs(run), "--rig", rig, "--allan", allan, "-o", "-")
    assert "bias_instability 24 deg/h" in err


def test_a_ten_minute_log_takes_little_time(capsys, tmp_path):
    """Two seconds for the process are allowed; the work itself is measured here."""
    import time

    make = "simulate --imu mti-g --rate 10 --static 0 --rotation 0 --navigation 600 --quiet"
    assert rotcli(capsys, *make.split(), "-o", tmp_path)[0] == 0
    start = time.process_time()
    assert rotcli(capsys, "observe", *logs(tmp_path), "--quiet", "-o", tmp_path / "o.json")[0] == 0
    assert time.process_time() - start < 2.0


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ("--smooth", "--smooth needs an IMU log"),
        ("--window 0:10", "--window needs an IMU log"),
        ("--plot a.png", "--plot needs an IMU log or --sweep"),
        ("--sigma-scale -1", "'-1' is not a number from 0 to"),
        ("--sigma-tilt 0", "--sigma-tilt 0: must be above 0"),
        ("--sigma-gyro 5e-324", "--sigma-gyro 4.94066e-324: must be at least 1e-12"),
        ("--update-rate nan", "'nan' is not a number from 0 to"),
        ("--sweep yaw 0:1:1", "'yaw' is not one of 'roll', 'pitch', 'rate'"),
        ("--sweep pitch 0:1", "'0:1' is not A:B:STEP"),
        ("--acceleration 1", "'1' is not E,N or E,N,U"),
        ("--model cubic", "'cubic' is not one of"),
        ("LOG --sweep pitch 0:1:1", "--sweep and --acceleration are for the analysis"),
        ("LOG --rate 3", "--rate: with a log the rate comes from the table log"),
        ("LOG TABLE --axis none", "omit the table log"),
        ("--axis q", "axis: 'q' is"),
        ("--axis 0,0,0", "axis: "),
        ("--pitch 100", "pitch: 100.0 is out of range"),
        ("LOG TABLE --latitude 95", "latitude: 95.0 is out of range"),
        ("--sweep pitch 1:0:1", "sweep of pitch: the step does not lead from start to end"),
        ("--sweep pitch 0:1:nan", "sweep of pitch: the step does not lead"),
        ("--axis none --sweep rate 1:2:1", "sweep of rate: the table is still"),
        ("--acceleration 0,0,-9.8", "acceleration: in free fall no tilt"),
    ],
)
def test_a_command_line_without_sense_is_a_usage_error(capsys, run, options, text):
    imu, table = logs(run)
    words = [{"LOG": imu, "TABLE": table}.get(word, word) for word in options.split()]
    status, out, err = rotcli(capsys, "observe", *words)
    assert (status, out) == (2, "")
    assert text in err


def test_a_faulty_file_leaves_no_result_behind(capsys, run, tmp_path):
    output = tmp_path / "o.json"
    status, _, err = rotcli(
        capsys, "observe", *logs(run), "--calibration", run / "truth.json", "-o", output
    )
    assert status == 1
    assert "contains a result of kind simulation; a calibration is needed" in err
    assert not output.exists()
    status, _, err = rotcli(capsys, "observe", "--axis", "0,0,0", "-o", output)
    assert status == 2
    assert "has no direction" in err
    assert not output.exists()
