"""`rotcli observe` without a log: the analysis of a motion."""

import json

import numpy as np
import pytest

from tests.cli.navigation.observe_runs import rotcli


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
