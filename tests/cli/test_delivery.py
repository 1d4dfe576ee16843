"""Where results go: JSON under a name that says so."""

import json
import os

import pytest

from rotcli.cli.planning import budget
from rotcli.files.tables.writers import WRITERS

# What runs in a moment and would write its result.
RESULTS = {
    "navigate": ["{still}/imu.csv", "--static", "0:8"],
    "calibrate": ["{turning}/imu.parquet", "{turning}/table.parquet"],
    "srins calibrate": ["{still}/imu.csv", "{still}/table.csv", "--reference", "gnss.csv"],
    "allan": ["{still}/imu.csv"],
    "observe": ["--axis", "z"],
    "srins observe": [],
    "budget": ["--imu", "nav440"],
}
QUICK = [name for name in RESULTS if not name.startswith("srins")]


@pytest.fixture
def written(rotcli, still, turning, tmp_path):
    """Return a function that runs a command with -o NAME in a folder of its own."""

    def run(command, name):
        args = [text.format(still=still, turning=turning) for text in RESULTS[command]]
        return rotcli(*command.split(), *args, "-o", tmp_path / name)

    return run


@pytest.mark.parametrize("command", RESULTS)
@pytest.mark.parametrize("name", ["a.html", "a.b.JSN", "a.parquet"])
def test_a_result_under_the_name_of_another_kind_of_file_is_refused(
    command, name, written, tmp_path
):
    done = written(command, name)
    assert (done.status, done.out) == (2, "")
    (line,) = [line for line in done.err.splitlines() if line.startswith("Error: ")]
    better = (tmp_path / name).with_suffix(".json")
    assert line.startswith(
        f"Error: -o {tmp_path / name}: this command writes JSON; use -o {better}"
    )
    assert line.endswith("or rotcli report for tables")
    assert not (tmp_path / name).exists()


@pytest.mark.parametrize("command", [name for name in RESULTS if name != "budget"])
def test_a_result_is_no_table(command, written):
    done = written(command, "a.md")
    assert done.status == 2
    assert "or rotcli report for tables" in done.err


@pytest.mark.parametrize("command", QUICK)
def test_a_result_may_have_no_suffix_or_one_in_capitals(command, written, tmp_path):
    for name in ("plain", "loud.JSON"):
        assert written(command, name).status == 0
        assert json.loads((tmp_path / name).read_text())["schema"] == 1


def test_a_budget_is_written_as_each_kind_of_table_there_is(written, tmp_path):
    for suffix in WRITERS:
        assert written("budget", f"a{suffix}").status == 0
        assert (tmp_path / f"a{suffix}").read_text()[0] != "{"
        assert suffix in budget.command.help
    assert "(or .md, .tex, .csv, .txt)" in written("budget", "a.html").err


def test_a_pipe_may_be_called_anything(rotcli, tmp_path):
    pipe = tmp_path / "pipe.txt"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        assert rotcli("observe", "--axis", "z", "-o", pipe).status == 0
        assert b'"kind": "observability"' in os.read(reader, 200)
    finally:
        os.close(reader)


def test_the_folder_of_a_batch_may_have_a_suffix(rotcli, turning, tmp_path):
    out = tmp_path / "results.2016"
    done = rotcli("calibrate", "--batch", turning.parent, "--jobs", "1", "-o", out)
    assert done.status == 0
    assert list(out.rglob("calibration.json"))
