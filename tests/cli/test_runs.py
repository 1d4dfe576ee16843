"""simulate, calibrate and navigate on small real files: what they print and write."""

import json
import re

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.conftest import FIXTURES
from tests.recorded import write_xsens_still

RMS_KEYS = [
    "latitude_m",
    "longitude_m",
    "height_m",
    "v_north_mps",
    "v_east_mps",
    "v_up_mps",
    "pitch_deg",
    "roll_deg",
    "azimuth_deg",
    "horizontal_m",
    "horizontal_mps",
]


def _calibrated(rotcli, folder):
    outcome = rotcli(
        "calibrate", folder / "imu.parquet", folder / "table.parquet", "-o", folder / "c.json"
    )
    assert outcome.status == 0, outcome.err
    return json.loads((folder / "c.json").read_text())


def test_navigating_what_was_calibrated_on_is_reported(rotcli, tmp_path):
    args = "--imu nav440 --rate 60 --static 10 --rotation 15 --navigation 30 --seed 2"
    assert rotcli("simulate", *args.split(), "-o", tmp_path).status == 0
    logs = tmp_path / "imu.parquet", tmp_path / "table.parquet"
    _calibrated(rotcli, tmp_path)
    navigate = "navigate", *logs, "--calibration", tmp_path / "c.json", "--mode", "full"
    assert "was made on" not in rotcli(*navigate).err
    rig = (tmp_path / "rig.toml").read_text()
    (tmp_path / "rig.toml").write_text(rig[: rig.index("[stages]")])
    _calibrated(rotcli, tmp_path)  # on all that turns, which is what navigate takes, too
    said = rotcli(*navigate).err
    assert "c.json: was made on 4" in said
    assert "the errors are those of a fit" in said


def test_simulate_makes_the_same_bytes_from_the_same_seed(rotcli, tmp_path):
    for place in ("a", "b"):
        args = "--imu nav440 --rate 50 --seed 3 --static 5 --rotation 8 --navigation 5"
        assert rotcli("simulate", *args.split(), "-o", tmp_path / place).status == 0
    names = ["imu.parquet", "rig.toml", "table.parquet", "truth.json"]
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == names
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_simulate_is_where_a_rig_says(rotcli, tmp_path):
    (tmp_path / "mine.toml").write_text(
        "[site]\nlatitude = -30\n[attitude]\npitch = 12\n[table]\naxis = 'x'\n"
        "[imu]\nlever_arm = [0.0, 0.1, 0.0]\n[stages]\nstatic = [1, 2]\n"
    )
    args = "--imu ideal --rate 50 --static 5 --rotation 8 --navigation 5 --roll 3"
    place = tmp_path / "run"
    assert rotcli("simulate", *args.split(), "--rig", tmp_path / "mine.toml", "-o", place)[0] == 0
    rig = json.loads((place / "truth.json").read_text())["rig"]
    assert rig["site"]["latitude"] == -30.0
    assert rig["attitude"] == {"pitch": 12.0, "roll": 3.0, "azimuth": 0.0}
    assert (rig["table"]["axis"], rig["imu"]["lever_arm"]) == ("x", [0.0, 0.1, 0.0])
    assert rig["stages"]["static"] == [0.0, 5.0]  # of this run, not of that rig


def test_the_fixtures_are_what_their_recipe_makes(tmp_path, monkeypatch):
    import runpy

    recipe = runpy.run_path(str(FIXTURES / "make_fixtures.py"))
    monkeypatch.setitem(recipe["main"].__globals__, "HERE", tmp_path)
    recipe["main"]()
    for name in recipe["RUNS"]:
        rig = (FIXTURES / name / "rig.toml").read_text()
        assert (tmp_path / name / "rig.toml").read_text() == rig
    new = pq.read_table(tmp_path / "nav440_rate_60" / "imu.parquet").to_pydict()
    old = pq.read_table(FIXTURES / "nav440_rate_60" / "imu.parquet").to_pydict()
    for column in old:
        # Sines and Fourier transforms may differ in the last digits between machines.
        np.testing.assert_allclose(new[column], old[column], rtol=1e-9, atol=1e-12)


def test_calibrate_writes_what_the_format_says(rotcli, turning):
    doc = _calibrated(rotcli, turning)
    assert list(doc)[:5] == ["kind", "schema", "rotcli", "inputs", "rig"]
    assert (doc["kind"], doc["axis"]) == ("calibration", "z")
    assert [len(i["sha256"]) for i in doc["inputs"]] == [64, 64]
    assert doc["inputs"][0]["rows"] == 3101
    assert list(doc["parameters"]) == ["bias_x", "bias_y", "bias_z", "Kgxz", "Kgyz", "Kgz"]
    assert doc["covariance"]["order"] == list(doc["parameters"])
    truth = json.loads((turning / "truth.json").read_text())["gyro"]
    expected = [*truth["bias_dph"], truth["Kgxz_ppm"], truth["Kgyz_ppm"], truth["Kgz_ppm"]]
    for (name, q), value in zip(doc["parameters"].items(), expected, strict=True):
        assert abs(q["value"] - value) < 4 * q["sigma"], name
    variances = np.diag(doc["covariance"]["matrix"])
    np.testing.assert_allclose(
        np.sqrt(variances), [q["sigma"] for q in doc["parameters"].values()], rtol=1e-12
    )
    assert doc["rate"] == {"value": pytest.approx(60.0, abs=1e-5), "sigma": None, "unit": "deg/s"}
    assert doc["warnings"] == []


def test_the_same_input_gives_the_same_bytes(rotcli, turning):
    _calibrated(rotcli, turning)
    first = (turning / "c.json").read_bytes()
    _calibrated(rotcli, turning)
    assert (turning / "c.json").read_bytes() == first


def test_residuals_go_to_their_own_file(rotcli, turning):
    outcome = rotcli(
        "calibrate", turning / "imu.parquet", turning / "table.parquet",
        "--report-residuals", turning / "left.parquet",
    )  # fmt: skip
    assert outcome.status == 0
    left = pq.read_table(turning / "left.parquet").to_pydict()
    assert list(left) == ["time [s]", *(f"residual_{a} [deg/s]" for a in "xyz")]
    # Least squares leaves a mean of zero in every segment that it fits exactly.
    assert abs(np.mean(left["residual_x [deg/s]"])) < 1e-12


@pytest.mark.parametrize("mode", ["partial", "full"])
def test_navigate_writes_what_the_format_says(rotcli, turning, mode):
    _calibrated(rotcli, turning)
    outcome = rotcli(
        "navigate", turning / "imu.parquet", turning / "table.parquet", "--mode", mode,
        "--calibration", turning / "c.json", "-o", turning / "nav.json",
        "--solution", turning / "nav.parquet",
    )  # fmt: skip
    assert outcome.status == 0, outcome.err
    doc = json.loads((turning / "nav.json").read_text())
    assert (doc["kind"], doc["mode"], doc["duration_s"]) == ("navigation", mode, 10.0)
    for part in ("rms", "final", "max"):
        assert list(doc[part]) == RMS_KEYS
    solution = pq.read_table(turning / "nav.parquet").to_pydict()
    assert len(solution["time [s]"]) == 1001
    north = np.array(solution["err_north [m]"])
    assert doc["rms"]["latitude_m"] == pytest.approx(np.sqrt(np.mean(north**2)), rel=1e-12)
    assert doc["final"]["latitude_m"] == pytest.approx(north[-1], rel=1e-12)
    assert doc["max"]["latitude_m"] == pytest.approx(np.abs(north).max(), rel=1e-12)
    azimuth = np.array(solution["err_azimuth [deg]"])
    assert doc["rms"]["azimuth_deg"] == pytest.approx(np.sqrt(np.mean(azimuth**2)), rel=1e-12)


def test_two_modes_are_two_tables_or_two_files(rotcli, turning):
    _calibrated(rotcli, turning)
    logs = (turning / "imu.parquet", turning / "table.parquet")
    both = ("--mode", "partial", "--mode", "full", "--calibration", turning / "c.json")
    printed = rotcli("navigate", *logs, *both)
    assert printed.status == 0
    lines = printed.out.splitlines()
    assert lines[0] == "Navigation errors, partial, 10 s, mean table rate 60 deg/s"
    headings = ["error", "RMS", "expected", "99.9", "%", "ratio", "p", "final", "max"]
    assert lines[1].split() == headings
    assert "Navigation errors, full, 10 s, mean table rate 60 deg/s" in lines
    assert printed.out.count("p: chance of a larger RMS") == 1
    assert max(map(len, lines)) <= 80
    written = rotcli("navigate", *logs, *both, "-o", f"{turning}/{{mode}}.json")
    assert written.status == 0
    expected = (
        r"full\.json: full, 10 s, mean table rate 60 deg/s: horizontal [\d.]+ m, [\d.]+ m/s RMS"
    )
    assert re.search(expected, written.err)
    assert json.loads((turning / "full.json").read_text())["mode"] == "full"
    assert json.loads((turning / "partial.json").read_text())["mode"] == "partial"
    refused = rotcli("navigate", *logs, *both, "-o", turning / "one.json")
    assert refused.status == 2
    assert "several modes need {mode} in the name" in refused.err


def test_several_modes_are_drawn_in_one_figure_or_in_one_each(rotcli, turning, tmp_path):
    _calibrated(rotcli, turning)
    logs = (turning / "imu.parquet", turning / "table.parquet")
    both = ("--mode", "partial", "--mode", "full", "--calibration", turning / "c.json")
    assert rotcli("navigate", *logs, *both, "--plot", tmp_path / "both.png").status == 0
    assert rotcli("navigate", *logs, *both, "--plot", tmp_path / "{mode}.png").status == 0
    assert sorted(path.name for path in tmp_path.glob("*.png")) == [
        "both.png",
        "full.png",
        "partial.png",
    ]
    refused = rotcli("navigate", *logs, *both, "--solution", tmp_path / "s.csv")
    assert refused.status == 2


def test_a_still_log_needs_no_table_and_csv_equals_parquet(rotcli, still):
    outcome = rotcli("navigate", still / "imu.csv", "-o", "-")
    with_table = rotcli("navigate", still / "imu.csv", still / "table.csv", "-o", "-")
    assert outcome.status == with_table.status == 0
    assert json.loads(outcome.out)["rms"] == json.loads(with_table.out)["rms"]
    assert json.loads(outcome.out)["mode"] == "conventional"


def test_the_recorded_xsens_is_navigated_from_its_own_minute(rotcli, tmp_path):
    outcome = rotcli(
        "navigate", write_xsens_still(tmp_path),
        "--mode", "conventional", "--static", "0.5:30.5", "--window", "30.5:50.5", "-o", "-",
    )  # fmt: skip
    assert outcome.status == 0
    doc = json.loads(outcome.out)
    assert doc["duration_s"] == pytest.approx(20.0, abs=0.01)
    # Levelled by its own accelerometers, what is left after 20 s is noise and drift: white noise
    # of 0.002 m/s^2/sqrt(Hz) and a tilt of 0.1 deg (2 m at most); height has the scale error.
    assert 0.01 < doc["rms"]["horizontal_m"] < 10.0
    assert doc["rms"]["height_m"] < 10.0
    assert doc["rms"]["azimuth_deg"] < 1.0
    assert any("levelled" in text for text in doc["warnings"])


def test_the_plot_is_a_picture(rotcli, still):
    outcome = rotcli("navigate", still / "imu.csv", "--plot", still / "errors.png")
    assert outcome.status == 0
    assert (still / "errors.png").read_bytes().startswith(b"\x89PNG")


def test_increments_mount_direction_and_offset_report_the_same_story(rotcli, tmp_path):
    """A log of other conventions, described by its rig, navigates without error all the same."""
    place = tmp_path / "odd"
    args = "--imu ideal --rate -40 --axis x --pitch 10 --sampling increment --direction -1 --csv"
    lengths = "--static 5 --rotation 10 --navigation 20"
    assert rotcli("simulate", *args.split(), *lengths.split(), "-o", place).status == 0
    header = (place / "imu.csv").read_text().splitlines()[0]
    assert "gyro_x [rad]" in header
    assert "accel_x [m/s]" in header
    # Late stamps and turned axes, stated in the rig.
    lines = (place / "table.csv").read_text().splitlines()
    shifted = [f"{float(t) + 0.4!r},{a}" for t, a in (line.split(",") for line in lines[1:])]
    (place / "table.csv").write_text("\n".join([lines[0], *shifted]) + "\n")
    lines = (place / "imu.csv").read_text().splitlines()
    turned = []
    for line in lines[1:]:
        t, gx, gy, gz, ax, ay, az = line.split(",")
        turned.append(",".join([t, gy, f"{-float(gx)!r}", gz, ay, f"{-float(ax)!r}", az]))
    (place / "imu.csv").write_text("\n".join([lines[0], *turned]) + "\n")
    rig = (place / "rig.toml").read_text()
    assert "direction = -1" in rig
    rig = rig.replace("time_offset = 0.0", "time_offset = -0.4")
    rows = "[[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]"
    rig = rig.replace("[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]", rows)
    (place / "rig.toml").write_text(rig)
    calibrated = rotcli("calibrate", place / "imu.csv", place / "table.csv", "-o", place / "c.json")
    assert calibrated.status == 0, calibrated.err
    outcome = rotcli(
        "navigate", place / "imu.csv", place / "table.csv",
        "--mode", "full", "--calibration", place / "c.json", "-o", "-",
    )  # fmt: skip
    assert outcome.status == 0, outcome.err
    # Encoder steps of 1e-5 deg over 10 s leave some ppm in the calibration.
    assert json.loads(outcome.out)["rms"]["horizontal_m"] < 0.01
