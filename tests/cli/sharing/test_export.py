"""`rotcli export` from the commands' files to the text of another program."""

import json

import pytest

from rotcli.cli.sharing.export import FORMATS
from rotcli.export.formats import all_formats
from tests.cli.in_process import run
from tests.export import documents


@pytest.fixture
def results(tmp_path):
    paths = []
    for source, doc in (documents.allan(), documents.triad(), documents.thermal()):
        path = tmp_path / source.path
        path.write_text(json.dumps({"rotcli": "0.1.0", "inputs": [], **doc}))
        paths.append(str(path))
    return paths


def test_the_command_knows_every_format() -> None:
    assert tuple(all_formats()) == FORMATS


def test_a_file_is_written_with_a_line_on_losses(results, tmp_path) -> None:
    target = tmp_path / "imu.yaml"
    done = run("export", *results, "--to", "vins", "-o", str(target))
    assert done.returncode == 0
    assert "gyr_n: 0.001645512" in target.read_text()
    assert "lost: bias instability B, gyro biases" in done.stderr
    assert "warning: accel_x, accel_y, accel_z: K is not significant" in done.stderr
    again = tmp_path / "again.yaml"
    run("export", *results, "--to", "vins", "-o", str(again))
    assert again.read_bytes() == target.read_bytes()


def test_standard_output_is_the_file_alone(results) -> None:
    done = run("export", results[0], "--to", "kalibr", "--quiet")
    assert done.stdout.startswith("# Kalibr imu.yaml")
    assert done.stderr == ""


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{}", "not a result file"),
        ('{"kind": "allan", "schema": 7}', "schema 7"),
        ('{"kind": "allan", "schema": 1}', "not a valid allan result"),
        ('{"kind": "budget", "schema": 1}', "kind budget cannot be exported"),
    ],
)
def test_bad_inputs_are_one_line_and_leave_no_file(tmp_path, content, message) -> None:
    bad, target = tmp_path / "bad.json", tmp_path / "out.yaml"
    bad.write_text(content)
    done = run("export", str(bad), "--to", "kalibr", "-o", str(target))
    assert done.returncode == 1
    assert message in done.stderr
    assert done.stderr.count("\n") == 1
    assert not target.exists()


def test_an_output_that_is_an_input_is_a_usage_error(results) -> None:
    done = run("export", results[0], "--to", "kalibr", "-o", results[0])
    assert done.returncode == 2


@pytest.mark.parametrize("target", ["kalibr", "gazebo", "matlab"])
def test_control_characters_of_a_name_are_shown_as_escapes(tmp_path, target) -> None:
    source, doc = documents.allan()
    doc.setdefault("rig", {})["imu"] = {"name": "\x1b]0;p\x07\u202e"}
    path = tmp_path / source.path
    path.write_text(json.dumps({"rotcli": "0.1.0", "inputs": [], **doc}))
    done = run("export", str(path), "--to", target)
    assert "device: \\x1b]0;p\\x07\\u202e" in done.stdout
    assert not any(sign in done.stdout for sign in "\x1b\x07\u202e")
