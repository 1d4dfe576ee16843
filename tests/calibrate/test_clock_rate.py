"""A table clock at another rate: calibrate says what to set, and what it says makes it right."""

import json
import re

import pyarrow.parquet as pq
import pytest

SCENARIO = """
profile = "nav440"
seed = 5

[table]
axis = "z"
"""
# still, +30, still, -30, still (deg/s), s: four changes of the rate over five minutes
LEGS = [(60, 0.0, "static"), (60, 30.0, "rotation"), (60, 0.0, ""), (60, -30.0, ""), (60, 0.0, "")]


@pytest.fixture(scope="module")
def scenario():
    text = SCENARIO
    for duration, rate, stage in LEGS:
        text += f"\n[[leg]]\nduration = {duration}\nrate = {rate}\n"
        text += f'stage = "{stage}"\n' if stage else ""
    return text


@pytest.fixture
def run(rotcli, tmp_path, scenario):
    """Return a maker of a run whose table clock is fast by some ppm and late by some seconds."""

    def make(ppm, late):
        path = tmp_path / f"run{ppm}"
        (tmp_path / "scenario.toml").write_text(scenario)
        assert rotcli("simulate", "--scenario", tmp_path / "scenario.toml", "-o", path).status == 0
        rig = (path / "rig.toml").read_text()
        rig = rig.partition("[stages]")[0]  # segments are found, on either clock
        (path / "rig.toml").write_text(rig)
        table = pq.read_table(path / "table.parquet")
        at = next(k for k, name in enumerate(table.column_names) if name.startswith("time"))
        time = table.column(at).to_numpy()
        changed = time[0] + (time - time[0]) * (1.0 + 1e-6 * ppm) + late
        table = table.set_column(at, table.field(at), [changed])
        pq.write_table(table, path / "table.parquet")
        return path

    return make


def _calibrate(rotcli, path):
    """Return what is said, and the values with their sigmas; none where the log is refused."""
    done = rotcli("calibrate", path / "imu.parquet", path / "table.parquet", "-o", path / "c.json")
    if done.status:
        return done.err, {}
    document = json.loads((path / "c.json").read_text())
    return done.err, {name: (q["value"], q["sigma"]) for name, q in document["parameters"].items()}


def test_thirty_ppm_are_silent(rotcli, run):
    said, _ = _calibrate(rotcli, run(30.0, 0.0))
    assert "warning" not in said


@pytest.mark.parametrize(("ppm", "late"), [(300.0, 0.0), (-300.0, 0.004), (1000.0, -0.003)])
def test_the_advice_is_right_and_works(rotcli, run, ppm, late):
    _, clean = _calibrate(rotcli, run(0.0, 0.0))
    path = run(ppm, late)
    said, wrong = _calibrate(rotcli, path)
    assert not wrong  # two samples and more at the last change of the rate: an error
    advice = re.search(r"set \[table\] clock_rate = (\S+) and time_offset = (\S+)", said)
    assert advice, said
    # A clock that is fast by ppm and late: (t - t0) (1 - ppm + ppm^2) - late.
    rate, offset = float(advice[1]), float(advice[2].rstrip(".)"))
    sigma = float(re.search(r"\(sigma (\S+) ppm\)", said)[1])
    assert rate == pytest.approx(-ppm + 1e-6 * ppm**2, abs=4.0 * sigma)
    rig = (path / "rig.toml").read_text()
    rig = re.sub(r"(?m)^clock_rate = .*$", f"clock_rate = {rate}", rig)
    rig = re.sub(r"(?m)^time_offset = .*$", f"time_offset = {offset}", rig)
    (path / "rig.toml").write_text(rig)
    said, right = _calibrate(rotcli, path)
    assert "warning" not in said
    for name, (value, error) in right.items():
        reference = clean[name][0]
        scale = sigma if name == "Kgz" else 0.0  # the advised rate has its own error, ppm
        assert abs(value - reference) < 3.0 * scale + 0.1 * error, name
