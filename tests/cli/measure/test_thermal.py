"""`rotcli thermal` on simulated logs: curves against the truth, ranges, warm-up, errors."""

import json
from pathlib import Path

import numpy as np
import pytest

from rotcli.logs.imu import read_imu
from rotcli.logs.temperature import read_temperature
from rotcli.models.laboratory.environment import Environment
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import default_rig, read_rig, rig_from_dict
from rotcli.rig.scenario import Leg, Scenario
from rotcli.simulate.api import simulate_run
from tests.scale.sets import DEG, DPH, PPM

SOAKS = [0, 10, 20, 30, 40, 40, 30, 20, 10, 0]
BIAS = np.tile(np.array([10.0, -0.1]) * DPH, (3, 1))
SCALE = np.tile(np.array([20.0]) * PPM, (3, 1))


@pytest.fixture
def rig(laboratory):
    return rig_from_dict(laboratory)


def write(folder, rig, legs, points, *, seed=1, imu="nav440", **more):
    environment = Environment(
        temperature=np.array(points, float) if points else None,
        gyro_bias=BIAS,
        gyro_scale=SCALE,
        **more,
    )
    scenario = Scenario(read_profile(imu), tuple(legs), rig, seed=seed, environment=environment)
    simulate_run(scenario).write(str(folder))
    return folder / "imu.parquet", folder / "table.parquet"


def soaks(folder, rig, temperatures=SOAKS, still=20.0, turning=12.0, change=30.0, **more):
    """Still, +50 and -50 deg/s at every temperature; 1 s ramps of the table."""
    legs, points, now = [], [], 0.0
    for k, T in enumerate(temperatures):
        legs += [Leg(still), Leg(turning, 50 * DEG), Leg(turning, -50 * DEG)]
        length = still + 2 * turning + 3.0 - (k == 0) * 0.0
        points += [[now, T], [now + length, T]]
        now += length
        if k + 1 < len(temperatures):
            legs.append(Leg(change))
            now += change + 1.0
    return write(folder, rig, legs, points, **more)


@pytest.fixture(scope="module")
def soaked(tmp_path_factory, laboratory):
    """Logs of the usual soaks, simulated once."""
    return soaks(tmp_path_factory.mktemp("soaks") / "run", rig_from_dict(laboratory))


def result(rotcli, *arguments):
    path = arguments[-1]
    outcome = rotcli("thermal", *arguments[:-1], "-o", path)
    assert outcome.status == 0, outcome.err
    return json.loads(path.read_text()), outcome


def test_soaks_give_bias_and_scale_factor_over_temperature(rotcli, rig, soaked, tmp_path):
    logs = soaked
    plot = tmp_path / "t.png"
    doc, outcome = result(
        rotcli, *logs, "--reference", 20, "--order", "2,1", "--plot", plot, tmp_path / "t.json"
    )
    assert (doc["kind"], doc["model"]) == ("calibration", "thermal")
    assert doc["temperature"]["low"] == pytest.approx(0.0, abs=0.1)
    assert doc["temperature"]["high"] == pytest.approx(40.0, abs=0.1)
    powers = doc["channels"]["gyro_z"]["powers"]
    for n, true in ((1, 10.0), (2, -0.1)):
        error = (powers["bias"]["value"][n] - true) / powers["bias"]["sigma"][n]
        assert abs(error) < 4
    assert abs((powers["scale"]["value"][1] - 20) / powers["scale"]["sigma"][1]) < 4
    K = doc["parameters"]["Kgz"]
    assert abs((K["value"] - 1200) / K["sigma"]) < 4
    assert powers["scale"]["value"][0] == pytest.approx(K["value"])
    # A tilt of the accelerometers by their bias: 0.022 and 0.050 m/s^2 of the profile.
    accel = doc["channels"]["accel_z"]
    assert accel["soaks"][0]["bias"]["value"] == pytest.approx(0.05, abs=0.004)
    assert doc["channels"]["gyro_x"]["left_out_soaks"]["chi2_per_value"] < 3
    assert plot.stat().st_size > 10_000
    assert "bias over 0.0 to 40.0 degC" in outcome.err


def test_the_tables_name_orders_soaks_and_directions(rotcli, rig, soaked, tmp_path):
    outcome = rotcli("thermal", *soaked)
    assert outcome.status == 0, outcome.err
    for text in ("left-out", "soaks", "coefficients of (T - 20 degC)^n", "heating against"):
        assert text in outcome.out


def test_a_temperature_outside_the_range_is_refused_clamped_or_replaced(
    rotcli, rig, soaked, tmp_path
):
    logs = soaked
    result(rotcli, *logs, "--order", "2,1", tmp_path / "t.json")
    hot = write(tmp_path / "hot", rig, [Leg(20.0)], [[0, 35], [20, 60]])
    clean = tmp_path / "clean.parquet"
    correct = ("correct", hot[0], "--calibration", tmp_path / "t.json", "-o", clean)
    outcome = rotcli(*correct)
    assert outcome.status == 1
    assert "temperature:" in outcome.err
    assert "is outside 0.0 to 40.0 degC" in outcome.err
    assert not clean.exists()
    outcome = rotcli(*correct, "--extrapolate", "clamp")
    assert outcome.status == 0
    assert "samples (" in outcome.err
    assert rotcli(*correct, "--temperature", 30).status == 0


def test_a_log_without_temperature_needs_a_constant_one(rotcli, rig, soaked, tmp_path):
    result(rotcli, *soaked, tmp_path / "t.json")
    plain = write(tmp_path / "plain", rig, [Leg(20.0)], None)
    clean = tmp_path / "clean.parquet"
    correct = ("correct", plain[0], "--calibration", tmp_path / "t.json", "-o", clean)
    outcome = rotcli(*correct)
    assert outcome.status == 1
    assert "no temperature column" in outcome.err
    assert rotcli(*correct, "--temperature", 25).status == 0
    assert rotcli(*correct, "--temperature", 80).status == 1
    assert "no temperature column" in rotcli("thermal", *plain).err


def test_a_corrected_log_has_no_bias_over_temperature(rotcli, rig, tmp_path):
    logs = soaks(tmp_path / "run", rig, imu="ideal")
    path = tmp_path / "run" / "rig.toml"
    figures = "angle_random_walk = 0.01\nbias_instability = 0.01\nvelocity_random_walk = 0.001\n"
    path.write_text(path.read_text().replace("[imu]\n", f"[imu]\n{figures}"))
    result(rotcli, *logs, "--order", "2,1", tmp_path / "t.json")
    clean = tmp_path / "clean.parquet"
    outcome = rotcli("correct", logs[0], "--calibration", tmp_path / "t.json", "-o", clean)
    assert outcome.status == 0, outcome.err
    log = read_imu(str(clean), read_rig(str(path)))
    earth = 15.041 / 3600 * np.sin(np.deg2rad(51.08))
    for start, rate in ((5, 0), (23, 50), (36, -50), (245, 0)):
        got = log.crop(start, start + 6).gyro[:, 2].mean() / DEG
        # The filter of the temperature rounds the corners of these fast changes: 1 deg/h of 200.
        assert got == pytest.approx(rate + earth, abs=3e-4)


def test_hat_functions_replace_the_polynomial(rotcli, soaked, tmp_path):
    doc, outcome = result(rotcli, *soaked, "--knots", "0,20,40", tmp_path / "t.json")
    z = doc["channels"]["gyro_z"]
    assert (z["bias_order"], z["powers"], z["knots_degC"]) == (None, None, [0, 20, 40])
    assert "hat functions" in outcome.err
    # The truth 10 x - 0.1 x^2 deg/h, x = T - 20, at the knots -20, 0, 20.
    bias = doc["curve"]["gyro_z"]["bias"]
    assert bias[-1] - bias[0] == pytest.approx(400, abs=120)
    clean = tmp_path / "clean.parquet"
    done = rotcli("correct", soaked[0], "--calibration", tmp_path / "t.json", "-o", clean)
    assert done.status == 0
    assert rotcli("thermal", *soaked, "--knots", "20,10").status == 2
    assert rotcli("thermal", *soaked, "--knots", "0,40").status == 0


def test_a_warm_up_is_measured_with_its_time(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig, [Leg(900.0)], None, warm_up=400 * DPH, warm_up_time=100.0)
    plot = tmp_path / "w.svg"
    doc, outcome = result(
        rotcli, "--warm-up", logs[0], "--limit", 20, "--plot", plot, tmp_path / "w.json"
    )
    assert doc["kind"] == "warm-up"
    z = doc["channels"]["gyro_z"]
    assert z["accepted"]
    assert abs(np.log(z["time_constant"]["value"] / 100)) < 4 * z["sigma_ln_tau"]
    assert z["warm_up_time_s"] == pytest.approx(
        z["time_constant"]["value"] * np.log(abs(z["amplitude"]["value"]) / 20)
    )
    assert doc["warm_up_time_s"] >= z["warm_up_time_s"]
    assert "warm-up time" in outcome.err
    assert plot.exists()
    assert "warm-up" in rotcli("thermal", "--warm-up", logs[0]).out


def test_calibrate_warns_of_segments_in_the_warm_up(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig, [Leg(900.0)], None, warm_up=400 * DPH, warm_up_time=100.0)
    result(rotcli, "--warm-up", logs[0], "--limit", 20, tmp_path / "w.json")
    cold = write(tmp_path / "cold", rig, [Leg(20.0), Leg(20.0, 50 * DEG)], None)
    outcome = rotcli("calibrate", *cold, "--warm-up", tmp_path / "w.json")
    assert outcome.status == 0
    assert "begins before the warm-up of" in outcome.err
    assert "warm-up" not in rotcli("calibrate", *cold).err


def test_calibrate_warns_of_a_changing_temperature(rotcli, rig, tmp_path):
    legs = [Leg(20.0), Leg(20.0, 50 * DEG)]
    changing = write(tmp_path / "run", rig, legs, [[0, 20], [40, 25]])
    outcome = rotcli("calibrate", *changing)
    assert outcome.status == 0
    assert "the temperature changes from 20." in outcome.err
    steady = write(tmp_path / "steady", rig, legs, [[0, 20], [40, 20.5]])
    assert "the temperature changes" not in rotcli("calibrate", *steady).err


def test_a_still_log_without_warm_up_needs_no_time(rotcli, rig, tmp_path):
    logs = write(tmp_path / "run", rig, [Leg(600.0)], None)
    doc, _ = result(rotcli, "--warm-up", logs[0], tmp_path / "w.json")
    assert doc["warm_up_time_s"] == 0.0
    assert not any(c["accepted"] for c in doc["channels"].values())


def test_a_ramp_of_a_still_log_is_a_test(rotcli, rig, tmp_path):
    imu_log, _ = write(tmp_path / "run", rig, [Leg(1200.0)], [[0, 10], [600, 40], [1200, 10]])
    doc, _ = result(rotcli, imu_log, "--block", 20, tmp_path / "t.json")
    z = doc["channels"]["gyro_z"]
    assert z["scale_order"] is None
    assert z["bias_order"] >= 1
    assert z["directions"]["offset"]["sigma"] > 0


def test_a_small_swing_is_an_error(rotcli, rig, tmp_path):
    imu_log, _ = write(tmp_path / "run", rig, [Leg(600.0)], [[0, 20], [600, 21]])
    outcome = rotcli("thermal", imu_log)
    assert outcome.status == 1
    assert "the temperature changes by" in outcome.err


def test_heating_alone_is_a_warning(rotcli, rig, tmp_path):
    logs = soaks(tmp_path / "run", rig, [0, 10, 20, 30, 40])
    _, outcome = result(rotcli, *logs, tmp_path / "t.json")
    assert "contain no cooling" in outcome.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--order", "7"), "orders up to 5"),
        (("--order", "x"), "not one or two orders"),
        (("--power-on", "3"), "needs --warm-up"),
        (("--warm-up", "--order", "2"), "not for --warm-up"),
    ],
)
def test_options_that_do_not_belong_together_are_usage_errors(rotcli, arguments, message):
    outcome = rotcli("thermal", "imu.csv", *arguments)
    assert outcome.status == 2
    assert message in outcome.err


def test_thermal_and_single_axis_calibrations_contradict_each_other(rotcli, rig, soaked, tmp_path):
    logs = soaked
    result(rotcli, *logs, tmp_path / "t.json")
    assert rotcli("calibrate", *logs, "-o", tmp_path / "c.json").status == 0
    both = ("--calibration", tmp_path / "t.json", "--calibration", tmp_path / "c.json")
    outcome = rotcli("correct", logs[0], *both, "-o", tmp_path / "clean.parquet")
    assert outcome.status == 1
    assert "omit this calibration" in outcome.err
    twice = ("--calibration", tmp_path / "t.json") * 2
    outcome = rotcli("correct", logs[0], *twice, "-o", tmp_path / "clean.parquet")
    assert "a second calibration of model thermal" in outcome.err


@pytest.mark.campaign
def test_raw_logs_through_the_command_scatter_by_their_sigmas(rotcli, rig, tmp_path):
    errors = []
    for seed in range(25):
        logs = soaks(tmp_path / f"{seed}", rig, still=60, turning=30, change=60, seed=seed)
        options = ("--reference", 20, "--order", "2,1")
        doc, _ = result(rotcli, *logs, *options, tmp_path / f"{seed}.json")
        powers = doc["channels"]["gyro_z"]["powers"]
        b, s = powers["bias"], powers["scale"]
        errors.append(
            [
                (b["value"][1] - 10) / b["sigma"][1],
                (b["value"][2] + 0.1) / b["sigma"][2],
                (s["value"][0] - 1200) / s["sigma"][0],
                (s["value"][1] - 20) / s["sigma"][1],
            ]
        )
    assert np.all(np.abs(np.std(errors, axis=0) - 1) < 0.42)  # 25 draws scatter by 14 %
    assert np.all(np.abs(np.mean(errors, axis=0)) < 0.6)


def _recorded(name: str) -> Path:
    """Return the folder of a device's recorded logs; skips where they are absent."""
    folder = Path(__file__).parents[3] / "build" / "recorded" / "tests" / "data" / name
    if not folder.exists():
        pytest.skip(f"no recorded logs at {folder}: run make recorded")
    return folder


def test_a_recorded_x_io_log_is_read_with_its_thermometer_and_refused_because_it_moves(
    rotcli, tmp_path
):
    folder = _recorded("data_xio3")
    imu = read_imu(folder / "Inertial.csv", default_rig())
    temperature = read_temperature(imu, default_rig(), log=folder / "Temperature.csv")
    np.testing.assert_array_equal(temperature.celsius, np.full(10, 30.0))
    assert temperature.at(np.array([imu.time[0], imu.time[-1]])) == pytest.approx(30.0)
    logs = (folder / "Inertial.csv", "--temperature-log", folder / "Temperature.csv")
    rig = tmp_path / "rig.toml"
    rig.write_text(
        "[imu]\nangle_random_walk = 0.6\nbias_instability = 10.0\n[stages]\nstatic = [392.2, 402]\n"
    )
    outcome = rotcli("thermal", "--warm-up", *logs, "--rig", rig, "--earth-rate", "ignore")
    assert outcome.status == 1
    assert "the gyros read (-71.21, 9.398, -31.64) deg/s from 393.195 s on" in outcome.err


def test_a_recorded_log_with_its_thermometer_is_read_and_analysed(rotcli, tmp_path):
    folder = _recorded("data_ngimu")
    rig = tmp_path / "rig.toml"
    rig.write_text(
        "[imu]\nangle_random_walk = 0.6\nbias_instability = 10.0\n[stages]\nstatic = [4.0, 9.9]\n"
    )
    logs = (folder / "sensors.csv", "--temperature-log", folder / "temperature.csv")
    settings = ("--rig", rig, "--earth-rate", "ignore", "--block", 0.5)
    outcome = rotcli("thermal", *logs, *settings)
    assert outcome.status == 1
    assert "the temperature changes by 0.1 degC; 3 are needed" in outcome.err  # 37.2 to 37.3
    doc, _ = result(rotcli, "--warm-up", *logs, *settings, tmp_path / "w.json")
    biases = [c["bias_after"]["value"] for c in doc["channels"].values()]
    assert len(biases) == 3
    assert not any(c["accepted"] for c in doc["channels"].values())


def test_the_functions_for_notebooks_give_the_documents_of_the_commands(rotcli, soaked, tmp_path):
    import rotcli as package

    doc, _ = result(rotcli, *soaked, "--order", "2,1", tmp_path / "t.json")
    from rotcli.thermal.api import ThermalOptions

    found = package.thermal(*map(str, soaked), options=ThermalOptions(orders=(2, 1)))
    powers = found.document["channels"]["gyro_z"]["powers"]["bias"]["value"]
    np.testing.assert_array_equal(powers, doc["channels"]["gyro_z"]["powers"]["bias"]["value"])
    K = package.scale(*map(str, soaked)).document["parameters"]["Kgz"]
    assert abs(K["value"] - 1200) < 0.2 * 1200  # the temperature changes it by 20 ppm/degC
    assert next(iter(found.to_frame().columns)) == "sensor"
