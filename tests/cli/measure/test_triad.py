"""`rotcli triad`, `correct` and `simulate --sequence` on small logs."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import rotcli as package
from rotcli.cli.main import main
from rotcli.plan.api import PlanOptions
from tests.cli.measure.triad_runs import QUIET, calibrate_triad


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A simulated M5 of a sensor with white noise alone."""
    folder = tmp_path_factory.mktemp("triad")
    (folder / "quiet.toml").write_text(QUIET)
    arguments = ["--sequence", "M5", "--imu", str(folder / "quiet.toml"), "--errors", "typical"]
    with pytest.raises(SystemExit) as stop:
        main(["simulate", *arguments, "--seed", "3", "-o", str(folder / "run")])
    assert stop.value.code == 0
    return folder / "run"


def _errors(doc, run):
    truth = json.loads((run / "truth.json").read_text())["errors"]
    found = {}
    for name, entry in doc["parameters"].items():
        if entry["value"] is not None and entry["sigma"] and name != "gravity":
            found[name] = (entry["value"] - truth[name]["value"]) / entry["sigma"]
    return found


def test_a_simulated_sequence_returns_its_errors(rotcli, run):
    doc, done = calibrate_triad(rotcli, run)
    errors = _errors(doc, run)
    assert len(errors) == 53
    # 53 correlated values: four sigma for each, and their rms within its own spread.
    assert max(map(abs, errors.values())) < 4.0
    assert 0.7 < np.sqrt(np.mean(np.square(list(errors.values())))) < 1.35
    assert (doc["kind"], doc["model"], doc["convention"]) == ("calibration", "triad", "table")
    assert doc["covariance"]["order"] == list(doc["parameters"])
    assert np.array(doc["covariance"]["matrix"]).shape == (54, 54)
    assert doc["rank"] == 53
    assert "gravity and a common factor" in doc["null_directions"][0]["text"]
    assert "gyro matrix and biases to" in done.err
    assert done.out == ""


def test_tables_are_printed_without_o(rotcli, run):
    done = rotcli("triad", run / "imu.parquet", run / "table.parquet")
    assert done.status == 0
    for text in ("Kgxy", "clock_accel", "Residuals by kind of block", "(I + M)^-1 u"):
        assert text in done.out


def test_the_same_logs_give_the_same_bytes(rotcli, run):
    calibrate_triad(rotcli, run)
    first = (run / "triad.json").read_bytes()
    calibrate_triad(rotcli, run)
    assert (run / "triad.json").read_bytes() == first


def test_residuals_and_plot_are_written(rotcli, run):
    calibrate_triad(rotcli, run, "--residuals", run / "left.csv", "--plot", run / "left.svg")
    rows = (run / "left.csv").read_text().splitlines()
    assert rows[0].startswith("time [s],kind")
    assert (run / "left.svg").read_text().startswith("<?xml")


def test_corrected_readings_of_still_blocks_have_the_size_of_gravity(rotcli, run, tmp_path):
    calibrate_triad(rotcli, run)
    done = rotcli(
        "correct", run / "imu.parquet", "--calibration", run / "triad.json",
        "-o", tmp_path / "clean.parquet",
    )  # fmt: skip
    assert done.status == 0, done.err
    assert "w = (I + N)^-1 v" in done.err
    clean = pq.read_table(tmp_path / "clean.parquet").to_pandas()
    raw = pq.read_table(run / "imu.parquet").to_pandas()
    size = [
        np.linalg.norm(t[[f"accel_{a} [m/s^2]" for a in "xyz"]].to_numpy(), axis=1)
        for t in (clean, raw)
    ]
    middle = slice(500, 2500)  # a spin about the inner axis, levers of 20 mm: 0.02 m/s^2
    gravity = 9.8082695
    assert abs(size[0][middle].mean() - gravity) < 0.03
    rate = np.linalg.norm(clean[[f"gyro_{a} [rad/s]" for a in "xyz"]].to_numpy()[middle], axis=1)
    assert abs(np.rad2deg(rate.mean()) - 60.0) < 0.01


def _rig(run, tmp_path, **replaced):
    text = (run / "rig.toml").read_text()
    for old, new in replaced.items():
        assert old.replace("_", " ") in text or old in text
        text = text.replace(old, new)
    path = tmp_path / "rig.toml"
    path.write_text(text)
    return path


def test_two_wrong_encoder_signs_are_found_by_gravity(rotcli, run, tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text((run / "rig.toml").read_text() + "\ndirections = [1, -1, -1]\n")
    done = rotcli("triad", run / "imu.parquet", run / "table.parquet", "--rig", rig)
    assert done.status == 1
    assert "direction of table axis 2, 3" in done.err
    assert "directions = [1, 1, 1]" in done.err


def test_one_wrong_encoder_sign_is_found(rotcli, run, tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text((run / "rig.toml").read_text() + "\ndirections = [1, 1, -1]\n")
    done = rotcli("triad", run / "imu.parquet", run / "table.parquet", "--rig", rig)
    assert done.status == 1
    assert "direction of table axis 3" in done.err


def test_a_wrong_mounting_is_found_and_the_right_one_works(rotcli, run, tmp_path):
    # The readings' axes permuted: x_new = y, y_new = z, z_new = x.
    table = pq.read_table(run / "imu.parquet")
    names = list(table.column_names)
    order = {"x": "y", "y": "z", "z": "x"}
    moved = [n.replace(f"_{n.split('_')[1][0]}", f"_{order[n.split('_')[1][0]]}", 1)
             if "_" in n else n for n in names]  # fmt: skip
    columns = [table.column(m) for m in moved]
    pq.write_table(pa.table(dict(zip(names, columns, strict=True))), tmp_path / "imu.parquet")
    rig = tmp_path / "rig.toml"
    rig.write_text((run / "rig.toml").read_text())
    logs = (tmp_path / "imu.parquet", run / "table.parquet")
    done = rotcli("triad", *logs, "--rig", rig)
    assert done.status == 1
    assert "set [imu] mount = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]" in done.err
    fixed = rig.read_text().replace(
        "mount = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]",
        "mount = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]",
    )
    rig.write_text(fixed)
    done = rotcli("triad", *logs, "--rig", rig, "-o", tmp_path / "t.json")
    assert done.status == 0, done.err


def test_a_wrong_mount_in_the_rig_is_corrected_by_the_message(rotcli, run, tmp_path):
    identity = "mount = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]"
    text = (run / "rig.toml").read_text()
    assert identity in text
    rig = tmp_path / "rig.toml"
    rig.write_text(text.replace(identity, "mount = [[0, 1, 0], [0, 0, 1], [1, 0, 0]]"))
    done = rotcli("triad", run / "imu.parquet", run / "table.parquet", "--rig", rig)
    assert done.status == 1
    assert "set [imu] mount = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]" in done.err


def test_a_site_is_necessary(rotcli, run, tmp_path):
    rig = tmp_path / "rig.toml"
    rig.write_text('[table]\naxes = ["z", "x", "y"]\n')
    done = rotcli("triad", run / "imu.parquet", run / "table.parquet", "--rig", rig)
    assert done.status == 1
    assert "[site] latitude: missing" in done.err


def test_a_log_without_poses_and_without_a_table_is_an_error(rotcli, run):
    done = rotcli("triad", run / "imu.parquet")
    assert done.status == 1
    assert "still poses of at least 1.5 s found, 12 are necessary" in done.err


def test_wrong_options_are_usage_errors(rotcli, run):
    logs = (run / "imu.parquet", run / "table.parquet")
    assert rotcli("triad").status == 2
    assert rotcli("triad", *logs, "--parameters", "N,Q").status == 2
    assert rotcli("triad", "--merge", *logs).status == 2
    assert rotcli("simulate", "--sequence", "M5", "-o", run).status == 2
    wrong = rotcli("simulate", "--sequence", "M5", "--imu", "nav440", "--rate", "3", "-o", run)
    assert wrong.status == 2


def test_parameters_choose_what_is_estimated(rotcli, run):
    doc, _ = calibrate_triad(rotcli, run, "--parameters", "N,d,M,b,eps,table,tau,R")
    assert "gsens_xx" not in doc["parameters"]
    assert "gravity" not in doc["parameters"]
    doc, _ = calibrate_triad(rotcli, run, "--asymmetry", "--convention", "accelerometer")
    assert "gyro_asymmetry_x" in doc["parameters"]
    assert doc["parameters"]["Kaxy"] == {
        "value": 0.0, "sigma": 0.0, "unit": "ppm", "status": "estimated",
        "reason": "zero by convention",
    }  # fmt: skip


def _truth_as_calibration(run, path, **changes):
    truth = json.loads((run / "truth.json").read_text())
    parameters = {n: {**e, "sigma": 1.0} for n, e in truth["errors"].items()}
    for name, value in changes.items():
        parameters[name]["value"] = value
    doc = {"kind": "calibration", "schema": 1, "rotcli": "0", "inputs": [], "rig": {}}
    path.write_text(json.dumps({**doc, "model": "triad", "parameters": parameters}))
    return path


@pytest.fixture(scope="module")
def turning_run(tmp_path_factory):
    """One axis, 20 s still, then turning; typical errors of both triads, no levers."""
    folder = tmp_path_factory.mktemp("turning")
    (folder / "quiet.toml").write_text(QUIET)
    (folder / "errors.toml").write_text(
        "Kgx = 900\nKgy = -700\nKgz = 1500\nKgxz = 800\nbias_x = 90\nbias_z = -120\n"
        "gsens_xz = 15\ngsens_zz = -20\nKax = 800\nKaz = -1500\naccel_bias_z = 0.05\n"
    )
    (folder / "one.toml").write_text(
        "axes = ['z']\n[[steps]]\nhold = 20\n[[steps]]\nspin = 'axis'\nrate = 20\n"
        "turns = 4\nboth = false\n"
    )
    arguments = ["--sequence", "one.toml", "--imu", "quiet.toml", "--errors", "errors.toml"]
    arguments = [str(folder / a) if a.endswith(".toml") else a for a in arguments]
    with pytest.raises(SystemExit):
        main(["simulate", *arguments, "-o", str(folder / "run")])
    return folder / "run"


def test_navigation_applies_gyro_and_accelerometer_corrections(rotcli, turning_run, tmp_path):
    calibration = _truth_as_calibration(turning_run, tmp_path / "t.json")
    logs = (turning_run / "imu.parquet", turning_run / "table.parquet")
    rms = {}
    for mode in ("conventional", "partial", "full"):
        out = tmp_path / f"{mode}.json"
        done = rotcli("navigate", *logs, "--calibration", calibration, "--mode", mode,
                      "--window", "25:85", "-o", out)  # fmt: skip
        assert done.status == 0, done.err
        rms[mode] = json.loads(out.read_text())["rms"]
    # Scale factor 1500 ppm at 20 deg/s is 1.8 deg after 60 s; bias of 0.035 m/s^2 is 63 m.
    assert rms["full"]["azimuth_deg"] < 0.1 < 0.5 < rms["partial"]["azimuth_deg"]
    assert rms["full"]["height_m"] < 2.0 < 5.0 < rms["conventional"]["height_m"]


def test_observe_and_allan_apply_a_triad_calibration(rotcli, turning_run, tmp_path):
    calibration = _truth_as_calibration(turning_run, tmp_path / "t.json")
    logs = (turning_run / "imu.parquet", turning_run / "table.parquet")
    estimates = {}
    for name, options in (("raw", ()), ("clean", ("--calibration", calibration))):
        out = tmp_path / f"{name}.json"
        done = rotcli("observe", *logs, *options, "--window", "0:20", "-o", out)
        assert done.status == 0, done.err
        found = json.loads(out.read_text())["filter"]["estimates"]["gyro_bias_x"]
        estimates[name] = found["value"], found["sigma"]
    assert abs(estimates["clean"][0]) < 4.0 * estimates["clean"][1]
    assert abs(estimates["raw"][0]) > 60.0
    done = rotcli("allan", logs[0], "--window", "0:20", "--calibration", calibration,
                  "-o", tmp_path / "a.json")  # fmt: skip
    assert done.status == 0, done.err


def test_reports_show_a_triad_calibration_and_a_plan(rotcli, run, tmp_path):
    calibrate_triad(rotcli, run)
    done = rotcli("plan", "--table", "1", "--minutes", "3", "-o", tmp_path / "plan.json")
    assert done.status == 0, done.err
    results = (run / "triad.json", tmp_path / "plan.json")
    for name in ("r.html", "r.md", "r.tex", "r.csv"):
        done = rotcli("report", *results, "-o", tmp_path / name)
        assert done.status == 0, done.err
        text = (tmp_path / name).read_text()
        for wanted in ("Kgxy", "clock", "efficiency"):
            assert wanted in text.replace("\\_", "_"), (name, wanted)
    page = (tmp_path / "r.html").read_text()
    assert "Full calibration" in page
    assert "residuals before and after the calibration" in page
    assert "multiply by (I + M)^-1" in page


def test_budget_takes_a_triad_calibration(rotcli, run):
    calibrate_triad(rotcli, run)
    done = rotcli("budget", "--calibration", run / "triad.json", "--rate", "10")
    assert done.status == 0, done.err
    assert "gyro bias" in done.out


def test_the_public_functions_do_what_the_commands_do(run):
    found = package.triad(run / "imu.parquet", run / "table.parquet")
    assert found.to_frame().shape[0] == 54
    assert "gyro matrix" in found.one_line_summary()
    planned = package.plan(PlanOptions(axes=1, time=240.0))
    assert planned.document["kind"] == "plan"
