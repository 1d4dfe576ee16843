"""`rotcli srins` and `report` on a short voyage: status, messages, files."""

import json
import tracemalloc
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from rotcli.cli.main import main
from rotcli.srins.voyage.scenario import read_srins_scenario

SHORT = """
scenario = "srins"
duration = 1.5
rate = 2.0
seed = 5
"""


def run(*args):
    with pytest.raises(SystemExit) as stop:
        main([str(arg) for arg in args])
    return stop.value.code


@pytest.fixture(scope="module")
def voyage(tmp_path_factory):
    """A simulated voyage of an hour and a half at 2 Hz."""
    folder = tmp_path_factory.mktemp("srins")
    (folder / "short.toml").write_text(SHORT)
    scenario = folder / "short.toml"
    assert run("srins", "simulate", "--scenario", scenario, "-o", folder / "run", "--quiet") == 0
    return folder / "run"


def logs(voyage):
    files = [voyage / "imu.parquet", voyage / "table.parquet", "--reference"]
    return [*files, voyage / "gnss.parquet", "--settle", "0.5"]


def test_a_voyage_is_written_with_truth_and_settings(voyage):
    names = {path.name for path in voyage.iterdir()}
    assert names == {
        *("imu.parquet", "table.parquet", "gnss.parquet", "doppler.parquet", "truth.parquet"),
        *("rig.toml", "scenario.toml", "truth.json"),
    }
    imu = pq.read_table(voyage / "imu.parquet")
    assert imu.num_rows == 10800
    assert imu.column_names[1] == "gyro_x [rad/s]"
    truth = json.loads((voyage / "truth.json").read_text())
    assert truth["sensor_errors"]["gyro_bias_z"] == pytest.approx(0.003)
    assert 'sampling = "average"' in (voyage / "rig.toml").read_text()


def test_the_written_scenario_makes_the_same_logs_again(voyage, tmp_path):
    assert (
        run("srins", "simulate", "--scenario", voyage / "scenario.toml", "-o", tmp_path / "b") == 0
    )
    for name in ("imu.parquet", "gnss.parquet", "truth.json", "rig.toml"):
        assert (tmp_path / "b" / name).read_bytes() == (voyage / name).read_bytes()


def test_another_seed_makes_other_noise(voyage, tmp_path):
    scenario = voyage / "scenario.toml"
    assert run("srins", "simulate", "--scenario", scenario, "--seed", 9, "-o", tmp_path / "b") == 0
    assert "seed = 9" in (tmp_path / "b" / "scenario.toml").read_text()
    assert (tmp_path / "b/imu.parquet").read_bytes() != (voyage / "imu.parquet").read_bytes()


def test_the_shipped_maneuvers_are_scenarios_by_name():
    late = read_srins_scenario("srins-late")
    assert len(late.maneuvers) == 1
    assert late.maneuvers != read_srins_scenario("srins-early").maneuvers


def test_an_unknown_scenario_is_an_error(rotcli, tmp_path):
    found = rotcli("srins", "simulate", "--scenario", "srins-never", "-o", tmp_path / "b")
    assert found.status == 1
    assert "srins-never: cannot be read" in found.err
    assert not (tmp_path / "b").exists()


def test_calibration_of_a_voyage_is_a_document(rotcli, voyage, tmp_path):
    out, states, plot = tmp_path / "cal.json", tmp_path / "states.parquet", tmp_path / "drifts.svg"
    found = rotcli(
        *("srins", "calibrate", *logs(voyage), "--speed", voyage / "doppler.parquet"),
        *("--truth", voyage / "truth.json", "-o", out, "--solution", states, "--plot", plot),
    )
    assert (found.status, found.out) == (0, "")
    assert found.err == f"rotcli: {out}: SRINS calibration, damped, 1 h\n"
    doc = json.loads(out.read_text())
    assert (doc["kind"], doc["method"], doc["mode"]) == ("srins", "srins", "damped")
    assert [Path(log["path"]).stem for log in doc["inputs"]] == ["imu", "table", "gnss", "doppler"]
    assert doc["inputs"][0]["rows"] == 10800
    drift = doc["estimates"]["gyro_bias_z"]
    assert drift["unit"] == "deg/h"
    assert drift["sigma"] == pytest.approx(7.0e-3, rel=0.02)  # published for one hour
    assert abs(drift["value"] - 0.003) < 3 * drift["sigma"]
    assert doc["truth"]["gyro_bias_z"] == pytest.approx(0.003)
    assert doc["convergence"]["hours"] == [None, None, None]
    assert doc["expected_bias"]["value"] == pytest.approx(2.09e-4, rel=0.01)
    assert doc["consistency"]["gnss"]["sound"]
    assert set(doc["degrees"]) >= {"gyro_bias_z", "dV_E", "u4"}
    assert doc["warnings"] == []
    series = pq.read_table(states)
    assert series.num_rows == 360
    assert {"time [s]", "gyro_bias_z [deg/h]", "sigma_phi_U [arcsec]"} <= set(series.column_names)
    drawn = plot.read_text()
    assert drawn.startswith("<?xml")
    assert "SRINS, long-run calibration, damped, about z" in " ".join(drawn.split())
    assert "imu.parquet, " in drawn


def test_calibration_reads_as_a_table_and_says_what_it_assumed(rotcli, voyage, tmp_path):
    bare = tmp_path / "rig.toml"
    text = (voyage / "rig.toml").read_text()
    bare.write_text("\n".join(x for x in text.splitlines() if "random_walk" not in x))
    found = rotcli("srins", "calibrate", *logs(voyage), "--rig", bare)
    assert found.status == 0
    assert "gyro_bias_z" in found.out
    assert "cause an error of up to 2.09e-04 deg/h" in " ".join(found.out.split())
    assert "[imu] angle_random_walk is missing; 0.0005 deg/sqrt(h) is assumed" in found.err


def test_damping_can_be_off_other_or_estimated(voyage, tmp_path):
    modes = {}
    for name, more in {
        "off": ["--no-damping"],
        "other": ["--damping", "1e-3,8e-3,1e-2,8e-2", "--gnss-sigma", "0.01,10"],
        "estimated": ["--estimated-damping-states", "--filter-interval", "20"],
    }.items():
        out = tmp_path / f"{name}.json"
        args = ("srins", "calibrate", *logs(voyage), *more, "-o", out, "--quiet")
        assert run(*args) == 0
        modes[name] = json.loads(out.read_text())
    assert modes["off"]["mode"] == "undamped"
    assert modes["other"]["damping_radps"] == [1e-3, 8e-3, 1e-2, 8e-2]
    assert not modes["estimated"]["measured_damping_states"]
    assert modes["estimated"]["filter"]["interval_s"] == 20.0


@pytest.mark.parametrize(
    ("more", "status", "text"),
    [
        (["--settle", "1.45"], 1, "leave no time for the filter"),
        (["--damping", "1,2,3"], 2, "is not 4 numbers"),
        (["--damping", "0,1,1,1"], 2, "every number must be above 0"),
        (["--gnss-sigma", "0,1"], 2, "every number must be above 0"),
        (["--uncalibrated", "-1,2"], 2, "both must be 0 or more"),
        (["--speed", "missing.csv"], 1, "missing.csv"),
        (["--truth", "missing.json"], 1, "missing.json"),
    ],
)
def test_impossible_values_are_rejected_in_one_line(rotcli, voyage, tmp_path, more, status, text):
    out = tmp_path / "cal.json"
    found = rotcli("srins", "calibrate", *logs(voyage), *more, "-o", out)
    assert (found.status, found.out) == (status, "")
    assert text in found.err
    assert not out.exists()


def test_a_reference_is_needed(rotcli, voyage):
    found = rotcli("srins", "calibrate", voyage / "imu.parquet", voyage / "table.parquet")
    assert found.status == 2
    assert "Missing option '--reference'" in found.err


def test_a_rig_without_heading_or_upright_axis_is_refused(rotcli, voyage, tmp_path):
    text = (voyage / "rig.toml").read_text()
    for change, message in (
        (("azimuth = 0.0", ""), "[attitude] azimuth: missing"),
        (('axis = "z"', 'axis = "x"'), "rotates about z, up"),
        (("direction = 1", "direction = -1"), "check [table] direction"),
    ):
        rig = tmp_path / "rig.toml"
        rig.write_text(text.replace(*change))
        found = rotcli("srins", "calibrate", *logs(voyage), "--rig", rig)
        assert found.status == 1
        assert message in found.err


def test_observability_of_the_model_is_printed_next_to_the_papers(rotcli, tmp_path):
    found = rotcli("srins", "observe")
    assert found.status == 0
    printed = " ".join(found.out.split())
    assert "52.487" in printed
    assert "Rank at 1e-05: 9 (paper 9); true rank 13" in printed
    assert "cannot come from a correct model" in printed
    out = tmp_path / "obs.json"
    assert rotcli("srins", "observe", "--latitude", 30, "-o", out).status == 0
    doc = json.loads(out.read_text())
    assert doc["kind"] == "srins-observability"
    assert set(doc["degrees"]) == {"still", "one-stop", "two-stop"}
    assert rotcli("srins", "observe", "--latitude", 0).status == 2
    assert rotcli("srins", "observe", "--rate", 0).status == 2


def test_the_report_has_tables_figures_and_an_honest_word(rotcli, voyage, tmp_path):
    results = []
    for name, more in {"a": [], "b": ["--no-damping"]}.items():
        out = tmp_path / f"{name}.json"
        assert run("srins", "calibrate", *logs(voyage), *more, "-o", out) == 0
        results.append(out)
    found = rotcli("report", *results, "--published", "-o", tmp_path / "report.md")
    assert found.status == 0
    printed = (tmp_path / "report.md").read_text()
    assert "estimates against time" in printed
    assert "the estimate of the drift needs the damping" in printed
    assert "an early maneuver leaves a lasting offset" in printed
    page = tmp_path / "report.html"
    assert rotcli("report", *results, "-o", page).status == 0
    text = page.read_text()
    assert "INS velocity error, damped and undamped" in text
    assert text.count("<img") + text.count("<svg") >= 5


def test_memory_does_not_grow_with_the_log(voyage, tmp_path):
    # Ten times the rows of one piece: a chunk and the increments are in memory.
    from rotcli.files.columns import write_column_chunks
    from rotcli.logs.stream import StreamedImuLog, open_imu
    from rotcli.rig.rig import read_rig
    from rotcli.srins.navigate import preintegrate_log

    rows, dt = 100_000, 0.01
    rng = np.random.default_rng(0)

    def part(k):
        time = dt * (np.arange(rows) + k * rows)
        values = rng.standard_normal((6, rows))
        names = [f"{sensor}_{axis}" for sensor in ("gyro", "accel") for axis in "xyz"]
        return {"time": time, **dict(zip(names, values, strict=True))}

    path = tmp_path / "imu.parquet"
    write_column_chunks(path, map(part, range(10)))
    streamed = open_imu(path, read_rig(voyage / "rig.toml"), in_memory_factor=0.0)
    assert isinstance(streamed, StreamedImuLog)
    tracemalloc.start()
    increments, _ = preintegrate_log(streamed.chunks(slice(0, streamed.samples)), averages=True)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(increments) == 10_000
    # A piece of 100,000 records is 5.6 MB; its sums need about twenty columns of it. The complete
    # log would be 56 MB in the reader alone.
    assert peak < 45e6


def test_csv_logs_of_a_voyage_say_the_same_as_parquet(voyage, tmp_path):
    assert (
        run("srins", "simulate", "--scenario", voyage / "scenario.toml", "--csv", "-o", tmp_path)
        == 0
    )
    found = []
    for place, suffix in ((voyage, "parquet"), (tmp_path, "csv")):
        files = [place / f"{name}.{suffix}" for name in ("imu", "table", "gnss")]
        out = tmp_path / f"{suffix}.json"
        args = ("srins", "calibrate", *files[:2], "--reference", files[2])
        assert run(*args, "--settle", "0.5", "-o", out, "--quiet") == 0
        found.append(json.loads(out.read_text())["estimates"])
    # CSV keeps every digit.
    assert found[0] == found[1]
