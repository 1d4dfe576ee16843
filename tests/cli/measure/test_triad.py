"""`rotcli triad`, `correct` and `simulate --sequence` on small logs."""

import json
import os
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import rotcli as package
from rotcli.cli.main import main
from rotcli.models.triad import parameters as p
from rotcli.models.triad.conventions import convert
from rotcli.plan.api import PlanOptions
from rotcli.rig.profile import read_profile

_SHARED = Path(os.environ.get("ROTCLI_SHARED", Path(__file__).parents[4] / "shared"))
_XSENS = _SHARED / "data" / "xsens_mti_multiposition.csv"
_PSINS = _SHARED / "data" / "psins_19position" / "x"
QUIET = "name = 'quiet'\nrate = 100.0\n[gyro]\nangle_random_walk = 0.4\n[accel]\n" + (
    "velocity_random_walk = 0.05\n"
)


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


def _calibrate(rotcli, run, *options):
    out = run / "triad.json"
    done = rotcli("triad", run / "imu.parquet", run / "table.parquet", "-o", out, *options)
    assert done.status == 0, done.err
    return json.loads(out.read_text()), done


def _errors(doc, run):
    truth = json.loads((run / "truth.json").read_text())["errors"]
    found = {}
    for name, entry in doc["parameters"].items():
        if entry["value"] is not None and entry["sigma"] and name != "gravity":
            found[name] = (entry["value"] - truth[name]["value"]) / entry["sigma"]
    return found


def test_a_simulated_sequence_returns_its_errors(rotcli, run):
    doc, done = _calibrate(rotcli, run)
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
    _calibrate(rotcli, run)
    first = (run / "triad.json").read_bytes()
    _calibrate(rotcli, run)
    assert (run / "triad.json").read_bytes() == first


def test_residuals_and_plot_are_written(rotcli, run):
    _calibrate(rotcli, run, "--residuals", run / "left.csv", "--plot", run / "left.svg")
    rows = (run / "left.csv").read_text().splitlines()
    assert rows[0].startswith("time [s],kind")
    assert (run / "left.svg").read_text().startswith("<?xml")


def test_corrected_readings_of_still_blocks_have_the_size_of_gravity(rotcli, run, tmp_path):
    _calibrate(rotcli, run)
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
    doc, _ = _calibrate(rotcli, run, "--parameters", "N,d,M,b,eps,table,tau,R")
    assert "gsens_xx" not in doc["parameters"]
    assert "gravity" not in doc["parameters"]
    doc, _ = _calibrate(rotcli, run, "--asymmetry", "--convention", "accelerometer")
    assert "gyro_asymmetry_x" in doc["parameters"]
    assert doc["parameters"]["Kaxy"] == {
        "value": 0.0, "sigma": 0.0, "unit": "ppm", "status": "estimated",
        "reason": "zero by convention",
    }  # fmt: skip


def test_three_single_axis_calibrations_merge_into_one(rotcli, tmp_path):
    paths = []
    for axis in "xyz":
        folder = tmp_path / axis
        done = rotcli("simulate", "--imu", "nav440", "--rate", "60", "--axis", axis, "--seed", "5",
                      "--navigation", "0", "-o", folder)  # fmt: skip
        assert done.status == 0, done.err
        out = folder / "c.json"
        done = rotcli("calibrate", folder / "imu.parquet", folder / "table.parquet", "-o", out)
        assert done.status == 0, done.err
        paths.append(out)
    done = rotcli("triad", "--merge", *paths, "-o", tmp_path / "m.json")
    assert done.status == 0, done.err
    doc = json.loads((tmp_path / "m.json").read_text())
    gyro = read_profile("nav440").gyro
    for k, name in enumerate(list(doc["parameters"])[:9]):
        entry = doc["parameters"][name]
        assert abs(entry["value"] - gyro.matrix.ravel()[k] * 1e6) < 5.0 * entry["sigma"]
    assert len(doc["inputs"]) == 6
    done = rotcli("triad", "--merge", paths[0], paths[0], paths[1])
    assert done.status == 1
    assert "do not span space" in done.err


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


@pytest.mark.skipif(not _XSENS.exists(), reason=f"recorded log {_XSENS} is absent")
def test_the_recorded_log_is_calibrated_by_hand(rotcli, tmp_path):
    done = rotcli("triad", _XSENS, "-o", tmp_path / "x.json")
    assert done.status == 0, done.err
    doc = json.loads((tmp_path / "x.json").read_text())
    assert doc["method"] == "hand-held"
    assert doc["details"]["carried_rms_held_out_deg"] < 0.2
    assert "[site] is missing" in done.err


@pytest.mark.skipif(not _PSINS.exists(), reason=f"set {_PSINS} is absent")
def test_the_published_set_is_within_half_a_ppm(rotcli, tmp_path):
    done = rotcli("triad", _PSINS / "imu.parquet", _PSINS / "table.csv.gz", "--parameters",
                  "N,d,eps", "-o", tmp_path / "p.json")  # fmt: skip
    assert done.status == 0, done.err
    found = json.loads((tmp_path / "p.json").read_text())["parameters"]
    for name, value in (("Kgx", -10.0), ("Kgyx", 145.44), ("Kgzx", 242.41)):
        assert found[name]["value"] == pytest.approx(value, abs=0.5)
    for axis, value in zip("xyz", (-0.1, -0.2, -0.3), strict=True):
        assert found[f"bias_{axis}"]["value"] == pytest.approx(value, abs=0.05)


def test_reports_show_a_triad_calibration_and_a_plan(rotcli, run, tmp_path):
    _calibrate(rotcli, run)
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
    _calibrate(rotcli, run)
    done = rotcli("budget", "--calibration", run / "triad.json", "--rate", "10")
    assert done.status == 0, done.err
    assert "gyro bias" in done.out


def test_the_public_functions_do_what_the_commands_do(run):
    found = package.triad(run / "imu.parquet", run / "table.parquet")
    assert found.to_frame().shape[0] == 54
    assert "gyro matrix" in found.one_line_summary()
    planned = package.plan(PlanOptions(axes=1, time=240.0))
    assert planned.document["kind"] == "plan"


def test_one_vertical_axis_shows_one_column_the_biases_and_says_what_it_assumes(rotcli, tmp_path):
    (tmp_path / "quiet.toml").write_text(QUIET)
    (tmp_path / "errors.toml").write_text(
        "Kgz = 900\nKgxz = -400\nKgyz = 300\nbias_x = 50\nbias_y = -30\nbias_z = 20\n"
    )
    steps = "".join(f"[[steps]]\ngo = [{a}]\n[[steps]]\nhold = 20\n" for a in (0, 90, 180, 270))
    spin = "[[steps]]\ngo = [0]\n[[steps]]\nspin = 'axis'\nrate = 60\nturns = 5\n"
    (tmp_path / "one.toml").write_text("axes = ['z']\n" + steps + spin)
    names = ("--sequence", tmp_path / "one.toml", "--imu", tmp_path / "quiet.toml")
    done = rotcli("simulate", *names, "--errors", tmp_path / "errors.toml", "-o", tmp_path / "run")
    assert done.status == 0, done.err
    doc, done = _calibrate(rotcli, tmp_path / "run")
    assert doc["rank"] == 24
    assert doc["convention"] == "table"
    assert "Zero is assumed" in done.err
    found = doc["parameters"]
    wanted = {"Kgz": 900, "Kgxz": -400, "Kgyz": 300, "bias_x": 50, "bias_y": -30, "bias_z": 20}
    for name, value in wanted.items():
        assert abs(found[name]["value"] - value) < 4.5 * found[name]["sigma"]
    for name in ("Kgx", "Kay", "gsens_zz", "Ka2_z", "clock_accel"):
        assert found[name]["value"] is None
        assert "does not show" in found[name]["reason"]


def test_three_mountings_by_hand_about_a_horizontal_axis_show_both_triads(rotcli, tmp_path):
    (tmp_path / "quiet.toml").write_text(QUIET)
    mounts = ("[[0,1,0],[-1,0,0],[0,0,1]]", "[[0,0,1],[0,1,0],[-1,0,0]]")
    text = "axes = ['x']\n"
    for m in (1, 2, 3):
        text += f"[[steps]]\nmount = {m}\n"
        for a in range(0, 360, 90):
            text += f"[[steps]]\ngo = [{a}]\n[[steps]]\nhold = 10\n"
        text += "[[steps]]\ngo = [0]\n[[steps]]\nspin = 'axis'\nrate = 60\nturns = 4\n"
    text += "".join(f"[[mountings]]\nmount = {m}\n" for m in mounts)
    (tmp_path / "three.toml").write_text(text)
    names = ("--sequence", tmp_path / "three.toml", "--imu", tmp_path / "quiet.toml")
    run = tmp_path / "run"
    done = rotcli("simulate", *names, "--errors", "typical", "--seed", "4", "-o", run)
    assert done.status == 0, done.err
    doc, _ = _calibrate(rotcli, run)
    assert doc["convention"] == "accelerometer"
    assert any("rotation of all sensor axes" in d["text"] for d in doc["null_directions"])
    truth = json.loads((run / "truth.json").read_text())["errors"]
    x = np.array([truth[n]["value"] for n in p.names(3)]) * p.unit_factors(3)
    expected = convert(x, "accelerometer").x / p.unit_factors(3)
    for k, name in enumerate(p.NAMES[: p.ACCEL_BIAS.stop]):
        entry = doc["parameters"].get(name)
        if entry and entry["sigma"]:
            assert entry["value"] is not None, name
            assert abs(entry["value"] - expected[k]) < 4.5 * entry["sigma"], name
