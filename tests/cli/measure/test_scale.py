"""`rotcli scale` on simulated logs: figures against the truth, turn-ons, errors, application."""

import json

import numpy as np
import pytest

from rotcli.logs.imu import read_imu
from rotcli.models.laboratory.environment import Environment, RateNonlinearity
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import read_rig
from rotcli.rig.scenario import Leg, Scenario
from rotcli.simulate.api import simulate_run
from tests.scale.sets import ALTERNATING, DEG, DPH, IMUS

RATES = [0, 10, -10, 50, -50, 100, -100, 50, -50, 0]


def write(folder, laboratory_rig, rates=RATES, *, seed=1, cubic=0.0, seconds=12.0, imu="nav440"):
    nonlinearity = RateNonlinearity(100 * DEG, cubic=cubic * DPH)
    scenario = Scenario(
        read_profile(imu),
        tuple(Leg(seconds, rate * DEG) for rate in rates),
        laboratory_rig,
        seed=seed,
        environment=Environment(nonlinearity=nonlinearity) if cubic else None,
    )
    simulate_run(scenario).write(str(folder))
    return folder / "imu.parquet", folder / "table.parquet"


@pytest.fixture
def rig(laboratory):
    from rotcli.rig.rig import rig_from_dict

    return rig_from_dict(laboratory)


def result(rotcli, *arguments):
    path = arguments[-1]
    outcome = rotcli("scale", *arguments[:-1], "-o", path)
    assert outcome.status == 0, outcome.err
    return json.loads(path.read_text()), outcome


def test_a_log_gives_the_true_scale_factor_within_its_sigmas(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig)
    doc, outcome = result(rotcli, *logs, tmp_path / "scale.json")
    assert (doc["kind"], doc["model"], doc["main"]) == ("calibration", "scale", "z")
    for name, true in (("Kgxz", -1100), ("Kgyz", 800), ("Kgz", 1200)):
        K = doc["parameters"][name]
        assert abs(K["value"] - true) < 4 * K["sigma"]
        assert 10 < K["sigma"] < 40
    assert doc["full_scale"] == {
        "value": pytest.approx(400),
        "sigma": None,
        "unit": "deg/s",
        "source": "rated range",
    }
    end = doc["segments"][-1]["end_s"]
    assert doc["horizon"] == {"start_s": end, "end_s": end + 300}
    assert doc["misalignment"]["value"] == pytest.approx(np.hypot(1100, 800), abs=80)
    assert "scale factor about z" in outcome.err
    matrix = np.array(doc["covariance"]["matrix"])
    np.testing.assert_allclose(np.sqrt(matrix[5, 5]), doc["parameters"]["Kgz"]["sigma"])
    np.testing.assert_allclose(np.sqrt(matrix[2, 2]), doc["parameters"]["bias_z"]["sigma"])


def test_a_strong_cubic_is_found_and_drawn(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig, cubic=-600.0)
    plot = tmp_path / "scale.svg"
    options = ("--full-scale", "100", "--plot", plot)
    doc, outcome = result(rotcli, *logs, *options, tmp_path / "scale.json")
    main = doc["channels"]["z"]
    assert main["p_line"] < 1e-6
    assert main["model"] in ("odd", "cubic", "asym+odd", "table")
    assert doc["verdict"]["good"] is False
    assert "is not a straight line" in outcome.err
    assert plot.read_text().startswith("<?xml")
    assert [f["code"] for f in doc["findings"]].count("scale-nonlinear") == 1


def test_the_tables_have_figures_gyros_and_residuals(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig)
    outcome = rotcli("scale", *logs, "--model", "cubic")
    assert outcome.status == 0
    for text in ("scale factor error", "asymmetry", "hysteresis", "misalignment", "residuals"):
        assert text in outcome.out
    assert "cubic" in outcome.out


def test_several_turn_ons_give_the_repeatability(rotcli, rig, tmp_path):
    names = [write(tmp_path / f"run{k}", rig, seed=k) for k in range(3)]
    logs = [name for pair in names for name in pair]
    doc, _ = result(rotcli, *logs, tmp_path / "scale.json")
    found = doc["repeatability"]
    assert (found["logs"], len(found["per_log"])) == (3, 3)
    assert found["high_95"] > found["low_95"] >= 0
    assert len(doc["inputs"]) == 6
    assert rotcli("scale", *logs[:3]).status == 2


def test_slow_rates_give_dead_band_and_threshold(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig, [0, 0.5, -0.5, 2, -2, 0])
    doc, _ = result(rotcli, *logs, tmp_path / "scale.json")
    ratio = doc["channels"]["z"]["response_ratio"]
    assert ratio["dead_band_dps"] is None
    assert ratio["threshold_dps"] == pytest.approx(0.5, rel=1e-3)


def test_one_rate_is_an_error(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig, [50, 50])
    outcome = rotcli("scale", *logs)
    assert outcome.status == 1
    assert "two different rates" in outcome.err


def test_missing_noise_figures_are_an_error(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig)
    path = tmp_path / "run" / "rig.toml"
    lines = [line for line in path.read_text().splitlines() if "angle_random_walk" not in line]
    path.write_text("\n".join(lines))
    outcome = rotcli("scale", *logs)
    assert outcome.status == 1
    assert "angle_random_walk: missing" in outcome.err


def test_an_unavailable_model_is_an_error(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig, [0, 50, 0, 50])
    outcome = rotcli("scale", *logs, "--model", "cubic")
    assert outcome.status == 1
    assert "cannot separate the terms of cubic" in outcome.err


def test_a_corrected_log_reads_the_true_rates(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig, cubic=-600.0, imu="ideal")
    # An ideal IMU has no noise figures: those of the rig are what the fit weighs by.
    path = tmp_path / "run" / "rig.toml"
    figures = "angle_random_walk = 0.01\nbias_instability = 0.01\n"
    path.write_text(path.read_text().replace("[imu]\n", f"[imu]\n{figures}"))
    options = ("--model", "odd", "--full-scale", "100")
    result(rotcli, *logs, *options, tmp_path / "scale.json")
    clean = tmp_path / "clean.parquet"
    outcome = rotcli("correct", logs[0], "--calibration", tmp_path / "scale.json", "-o", clean)
    assert outcome.status == 0, outcome.err
    log = read_imu(str(clean), read_rig(str(path)))
    for k, rate in enumerate(RATES):
        middle = log.crop(13.0 * k + 4, 13.0 * k + 9).gyro[:, 2].mean()
        earth = 15.041 / 3600 * np.sin(np.deg2rad(51.08))
        assert middle / DEG == pytest.approx(rate + earth, abs=2e-5)  # 0.07 deg/h


def test_a_rate_outside_the_test_is_refused_or_clamped(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig, [0, 20, -20, 50, -50, 0])
    result(rotcli, *logs, tmp_path / "scale.json")
    fast = write(tmp_path / "fast", rig, [0, 100])
    clean = tmp_path / "clean.parquet"
    correct = ("correct", fast[0], "--calibration", tmp_path / "scale.json", "-o", clean)
    outcome = rotcli(*correct)
    assert outcome.status == 1
    assert "deg/s at" in outcome.err
    assert "outside -50 to 50 deg/s" in outcome.err
    assert not clean.exists()
    outcome = rotcli(*correct, "--extrapolate", "clamp")
    assert outcome.status == 0
    assert "samples are outside -50 to 50 deg/s" in outcome.err


def test_without_earth_rate_no_attitude_is_needed(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig)
    path = tmp_path / "run" / "rig.toml"
    path.write_text(
        path.read_text().split("[attitude]")[0] + "[imu]" + path.read_text().split("[imu]")[1]
    )
    assert "[attitude] pitch" in rotcli("scale", *logs).err
    assert rotcli("scale", *logs, "--earth-rate", "ignore").status == 0


@pytest.mark.campaign
@pytest.mark.parametrize("imu", ["nav440", "mti-g"])
def test_raw_logs_through_the_command_scatter_by_their_sigmas(rotcli, rig, tmp_path, imu):
    errors = []
    true = {"nav440": 1200.0, "mti-g": read_profile("mti-g").gyro.matrix[2, 2] * 1e6}[imu]
    for seed in range(40):
        logs = write(tmp_path / f"{seed}", rig, ALTERNATING, seed=seed, seconds=20, imu=imu)
        doc, _ = result(rotcli, *logs, "--model", "line", tmp_path / f"{seed}.json")
        K = doc["parameters"]["Kgz"]
        errors.append((K["value"] - true) / K["sigma"])
    assert np.std(errors) == pytest.approx(1.0, abs=0.3)  # 40 draws scatter by 11 %
    assert abs(np.mean(errors)) < 0.5
    assert IMUS  # the profiles of the exact sets


@pytest.mark.campaign
@pytest.mark.parametrize(("window", "error"), [((), 2.5), (("--window", "423:723"), 7.5)])
def test_a_calibration_at_50_deg_per_second_is_wrong_at_another_rate(
    rotcli, tmp_path, window, error
):
    run = tmp_path / "run"
    assert rotcli("simulate", "--scenario", "nonlinear-gyro", "-o", run).status == 0
    logs = run / "imu.parquet", run / "table.parquet"
    calibration = tmp_path / "c.json"
    assert rotcli("calibrate", *logs, "-o", calibration).status == 0
    options = ("--calibration", calibration, "--allow-other-rate", *window)
    path = tmp_path / "nav.json"
    assert rotcli("navigate", *logs, *options, "-o", path).status == 0
    final = json.loads(path.read_text())["final"]["azimuth_deg"]
    # e(50) = 0, e(100) = -30, e(-100) = 90 deg/h, over 300 s.
    assert abs(final) == pytest.approx(error, abs=0.01)


def test_an_oblique_axis_has_the_scale_factor_along_it(rotcli, laboratory, tmp_path):
    from rotcli.rig.rig import rig_from_dict

    rig = rig_from_dict({**laboratory, "table": {"axis": [1, 1, 1]}})
    logs = write(tmp_path / "run", rig)
    doc, outcome = result(rotcli, *logs, tmp_path / "scale.json")
    u = np.ones(3) / np.sqrt(3)
    N = read_profile("nav440").gyro.matrix * 1e6
    K = doc["channels"]["u"]["scale"]
    assert doc["main"] == "u"
    assert abs(K["value"] - u @ N @ u) < 4 * K["sigma"]
    for name, true in zip("xyz", N @ u, strict=True):
        K = doc["parameters"][f"Kg{name}u"]
        assert abs(K["value"] - true) < 4 * K["sigma"]
    across = N @ u - u * (u @ N @ u)
    alpha = doc["misalignment"]
    assert abs(alpha["value"] - np.linalg.norm(across)) < 4 * alpha["sigma"]
    assert "about (0.577, 0.577, 0.577)" in outcome.err
