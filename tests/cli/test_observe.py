"""`rotcli observe` on small files: exit status, messages, what is written."""

import json

import numpy as np
import pytest

from rotcli.cli.main import main


def rotcli(capsys, *args):
    """Run the command line; return exit status, standard output and standard error."""
    with pytest.raises(SystemExit) as stop:
        main([str(a) for a in args])
    out, err = capsys.readouterr()
    return stop.value.code, out, err


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


def logs(run):
    return run / "imu.parquet", run / "table.parquet"


def test_the_analysis_reads_as_a_table(capsys):
    status, out, err = rotcli(capsys, "observe", "--axis", "z", "--rate", "10")
    assert (status, err) == (0, "")
    assert "Observability, about z at 10 deg/s, simplified model: rank 8 of 12" in out
    assert "gamma_E - (g/w)*d_E" in out
    shown_text = " ".join(out.split())
    assert (
        "Tilt the axis by at least 10 deg: this separates vertical gyro bias and both" in shown_text
    )
    assert "accel_bias_y - g*eps_E" in out


def test_the_analysis_as_a_document_contains_the_contracts_fields(capsys):
    status, out, _ = rotcli(capsys, "observe", "--axis", "none", "--latitude", "45", "-o", "-")
    doc = json.loads(out)
    assert status == 0
    assert doc["kind"] == "observability"
    assert doc["model"] == "simplified"
    assert doc["axis"] == "none"
    assert doc["rate"] == {"value": 0.0, "sigma": None, "unit": "deg/s"}
    assert doc["rank"] == 8
    assert doc["unobservable"] == ["eps_U", "d_U"]
    assert [c["text"] for c in doc["combinations"]] == ["gamma_N - g*eps_E", "gamma_E + g*eps_N"]
    gravity = doc["combinations"][1]["coefficients"]["eps_N"]
    assert gravity == pytest.approx(9.8062, abs=1e-4)  # normal gravity at 45 deg (Somigliana)
    assert len(doc["states"]) == len(doc["degrees"]) == len(doc["singular_values"]) == 12
    assert doc["sensor_frame"]["unobservable"] == ["eps_U", "gyro_bias_z"]
    assert doc["warnings"] == []
    again = rotcli(capsys, "observe", "--axis", "none", "--latitude", "45", "-o", "-")[1]
    assert again == out


@pytest.mark.parametrize(
    ("options", "rank"),
    [
        ("--axis y", 10),
        ("--axis 0,0.6,0.8", 11),
        ("--axis x --roll 90", 8),
        ("--axis z --pitch 30 --model full", 12),
        ("--axis y --azimuth 90 --model full", 10),
        ("--axis y --pitch 30 --acceleration 1,0", 11),
        ("--axis y --pitch 30 --acceleration 1,0 --acceleration 0,1,0.5", 12),
        ("--rate 0", 8),
    ],
)
def test_options_describe_the_motion(capsys, options, rank):
    status, out, _ = rotcli(capsys, "observe", *options.split(), "-o", "-")
    assert status == 0
    assert json.loads(out)["rank"] == rank


def test_the_default_site_is_that_of_every_command(capsys):
    from rotcli.observe.observability import TableMotion
    from rotcli.rig.scenario import DEFAULT_SITE

    doc = json.loads(rotcli(capsys, "observe", "--axis", "none", "-o", "-")[1])
    assert doc["latitude_deg"] == pytest.approx(51.08, abs=1e-12)
    assert np.degrees([DEFAULT_SITE.latitude, TableMotion().latitude]) == pytest.approx(
        51.08, abs=1e-12
    )
    gravity = doc["combinations"][1]["coefficients"]["eps_N"]
    # Somigliana at 51.08 deg: 9.811662 m/s^2, less 3.086e-6 per metre of the site's 1100 m.
    assert gravity == pytest.approx(9.811662 - 1100.0 * 3.086e-6, abs=2e-5)


def test_a_sweep_gives_rank_and_degrees_and_a_plot(capsys, tmp_path):
    plot = tmp_path / "sweep.png"
    sweep = ["observe", "--axis", "z", "--sweep", "pitch", "-4:4:2"]
    status, out, _ = rotcli(capsys, *sweep, "-o", "-", "--plot", plot)
    found = json.loads(out)["sweep"]
    assert status == 0
    assert found["values"] == pytest.approx([-4, -2, 0, 2, 4])
    assert found["rank"] == [11, 11, 8, 11, 11]
    assert found["weak"] == [False, True, False, True, False]
    assert found["degrees"]["d_U"][2] == pytest.approx(0.0, abs=1e-9)
    assert plot.read_bytes().startswith(b"\x89PNG")
    status, out, _ = rotcli(capsys, *sweep)
    assert "Observability along pitch" in out
    assert "weak" in out


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
    assert "imu.parquet: --smooth: the history of" in err
    assert "Hz at most, a shorter --window, or omit --smooth" in err
    assert len(err.splitlines()) == 1
    assert not output.exists()


@pytest.mark.parametrize("case", ["still", "level z"])
def test_the_tool_itself_says_which_estimates_must_not_be_used(capsys, tmp_path, case):
    rate = "0" if case == "still" else "10"
    simulate = f"simulate --imu mti-g --rate {rate} --static 0 --rotation 0 --navigation 60 --quiet"
    assert rotcli(capsys, *simulate.split(), "-o", tmp_path)[0] == 0
    _, out, _ = rotcli(capsys, "observe", *logs(tmp_path), "-o", "-")
    bad = json.loads(out)["filter"]["not_to_be_used"]
    hidden = {"azimuth", "gyro_bias_z"}
    joint = {"tilt_east", "tilt_north", "accel_bias_x", "accel_bias_y"}
    joint |= {"gyro_bias_x", "gyro_bias_y"} if case == "level z" else set()
    assert hidden | joint <= set(bad)
    assert "accel_bias_z" not in bad
    assert "unobservable with this motion" in bad["gyro_bias_z"]
    assert "observable only in the combination accel_bias_x + g*eps_N" in bad["accel_bias_x"]
    _, out, _ = rotcli(capsys, "observe", *logs(tmp_path))
    assert "no: unobservable with this motion" in out


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


def test_every_estimate_says_whether_it_is_to_be_used_and_only_those_are_saved(capsys, tmp_path):
    make = "simulate --imu nav440 --pitch 30 --rate 20 --static 0 --rotation 0 --navigation 60"
    assert rotcli(capsys, *make.split(), "--quiet", "-o", tmp_path)[0] == 0
    rig, saved = tmp_path / "rig.toml", tmp_path / "saved.json"
    text = [line for line in rig.read_text().splitlines() if "scale_sigma" not in line]
    rig.write_text("\n".join(text))
    status, out, err = rotcli(capsys, "observe", *logs(tmp_path), "--save-calibration", saved)
    assert status == 0
    assert "3000 ppm is assumed" in err
    assert "not saved, unreliable: bias_x, bias_y, bias_z" in err
    rows = [
        line for line in out.splitlines() if line.startswith(("accel_bias_", "gyro_bias_", "Kg"))
    ]
    assert len(rows) == 9
    assert all(" yes" in row or " no: " in row for row in rows)
    read = json.loads(saved.read_text())
    assert set(read["parameters"]) == {f"accel_bias_{a}" for a in "xyz"}
    assert "a single rate does not separate it from Kgz" in read["left_out"]["bias_z"]
    status, _, err = rotcli(
        capsys, "navigate", *logs(tmp_path), "--mode", "partial", "--calibration", saved
    )
    assert status == 0, err
    assert "saved.json: contains no bias_x, bias_y, bias_z: not corrected" in err
    status, out, err = rotcli(capsys, "observe", *logs(tmp_path), "--sigma-scale", "0")
    assert status == 0
    assert "Kgz" not in out
    assert "no states of scale factor and installation errors: 1000 ppm" in err


def test_an_estimated_scale_factor_is_saved_and_nothing_at_all_is_refused(capsys, tmp_path):
    scenario, saved = tmp_path / "s.toml", tmp_path / "saved.json"
    legs = "".join(f"[[leg]]\nduration = 40.0\nrate = {rate}\n" for rate in (0.0, 20.0, -20.0))
    scenario.write_text(f'profile = "nav440"\n[attitude]\npitch = 30.0\nroll = 0.0\n{legs}')
    assert rotcli(capsys, "simulate", "--scenario", scenario, "--quiet", "-o", tmp_path)[0] == 0
    rest = ("--sigma-scale", "3000", "--save-calibration", saved, "-o", "-")
    status, out, err = rotcli(capsys, "observe", *logs(tmp_path), *rest)
    assert status == 0, err
    read, truth = json.loads(saved.read_text())["parameters"], (-1100.0, 800.0, 1200.0)
    for name, true in zip(("Kgxz", "Kgyz", "Kgz"), truth, strict=True):
        assert read[name]["unit"] == "ppm"
        assert abs(read[name]["value"] - true) < 4.0 * read[name]["sigma"]
        shown = json.loads(out)["filter"]["estimates"][name]
        assert read[name]["value"] == pytest.approx(shown["value"], rel=1e-12)
    before = saved.read_bytes()
    harsh = ("--sigma-measurement", "1e-4", *rest)
    rig = tmp_path / "rig.toml"
    lines = [x for x in rig.read_text().splitlines() if "random_walk" not in x]
    tight = "angle_random_walk = 0.04\nvelocity_random_walk = 0.003"
    rig.write_text("\n".join(lines).replace("[imu]", f"[imu]\n{tight}"))
    status, out, err = rotcli(capsys, "observe", *logs(tmp_path), *harsh)
    assert (status, out) == (1, "")
    assert "no bias estimate is reliable; no calibration is written" in err
    assert saved.read_bytes() == before


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


def test_a_lever_arm_is_estimated_by_name(capsys, tmp_path):
    scenario = tmp_path / "s.toml"
    scenario.write_text(
        'profile = "mti-g"\n[attitude]\npitch = 30.0\nroll = 0.0\nazimuth = 0.0\n'
        '[table]\naxis = "y"\n[imu]\nlever_arm = [0.06, 0.0, -0.04]\n'
        "[[leg]]\nduration = 40.0\nrate = 20.0\n[[leg]]\nduration = 40.0\nrate = 90.0\n"
    )
    assert rotcli(capsys, "simulate", "--scenario", scenario, "--quiet", "-o", tmp_path)[0] == 0
    rig = tmp_path / "rig.toml"
    rig.write_text(rig.read_text().replace("[0.06, 0.0, -0.04]", "[0.0, 0.0, 0.0]"))
    status, out, err = rotcli(capsys, "observe", *logs(tmp_path), "--estimate-lever-arm", "-o", "-")
    assert status == 0, err
    found = json.loads(out)["filter"]["estimates"]
    for name, true in (("lever_arm_x", 0.06), ("lever_arm_z", -0.04)):
        assert found[name]["unit"] == "m"
        assert found[name]["value"] == pytest.approx(true, abs=2e-3)
    assert "lever_arm_y" not in found


def test_the_analysis_loads_nothing_that_only_logs_and_faults_need():
    import subprocess
    import sys

    code = (
        "import sys; from rotcli.cli.main import main\n"
        "try: main('observe --axis z --quiet'.split())\n"
        "except SystemExit: pass\n"
        "print(*sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(run.stdout.splitlines()[-1].split())
    assert {"rotcli.observe.observability", "numpy"} < loaded
    spared = {"scipy", "pyarrow", "pandas", "matplotlib", "tomllib", "difflib", "csv", "html"}
    spared |= {"rotcli.observe.zupt", "rotcli.calibrate.estimate", "rotcli.observe.zupt.model"}
    assert not spared & loaded


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


def test_estimates_do_not_depend_on_how_the_table_counts(capsys, tmp_path):
    found = []
    for direction in ("1", "-1"):
        folder = tmp_path / direction
        make = "simulate --imu ideal --axis y --pitch 30 --rate 20 --static 0 --rotation 0"
        make += f" --navigation 30 --direction {direction} --quiet"
        assert rotcli(capsys, *make.split(), "-o", folder)[0] == 0
        out = rotcli(capsys, "observe", *logs(folder), "-o", "-")[1]
        estimates = json.loads(out)["filter"]["estimates"]
        found.append(
            [estimates[f"{s}_bias_{a}"]["value"] for s in ("accel", "gyro") for a in "xyz"]
        )
    np.testing.assert_allclose(found[0], found[1], atol=1e-3)
    assert np.abs(found[0]).max() < 0.05  # an ideal IMU has no biases: deg/h, m/s^2
