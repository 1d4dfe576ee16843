"""Hostile files are refused in one line, or shown letter by letter."""

import json
import re
import shutil
import tracemalloc
from pathlib import Path

import pytest

import rotcli as package
from faults import hostile
from fuzz import readers
from rotcli.errors import RotcliError
from rotcli.logs.profile import read_profile
from rotcli.logs.rig import read_rig
from rotcli.logs.scenario import read_scenario
from rotcli.results.files import read_result
from tests.cli.conftest import FIXTURES
from tests.cli.conftest import rotcli as rotcli  # the fixtures
from tests.cli.conftest import turning as turning


@pytest.mark.parametrize("name", hostile.LOGS)
def test_a_hostile_log_is_refused_in_one_line(name, rotcli, tmp_path):
    suffix, make, says, options = hostile.LOGS[name]
    path = tmp_path / f"imu{suffix}"
    make(path)
    done = rotcli("allan", path, *options)
    assert done.status == 1
    assert done.err.count("\n") == 1
    assert says in done.err
    assert len(done.err) < 1000


def test_the_limit_can_be_raised(rotcli, tmp_path):
    log = FIXTURES / "nav440_still" / "imu.csv"
    assert "raise --max-bytes" in rotcli("allan", log, "--max-bytes", "10k").err
    assert rotcli("allan", log, "--max-bytes", "10M", "-o", "-").status == 0
    assert "is not a number of bytes" in rotcli("allan", log, "--max-bytes", "many").err


@pytest.mark.parametrize("name", hostile.TOMLS)
def test_hostile_toml_is_refused(name, tmp_path):
    path = tmp_path / "f.toml"
    path.write_text(hostile.TOMLS[name])
    for read in (read_rig, read_scenario, read_profile):
        with pytest.raises(RotcliError) as caught:
            read(str(path))
        assert len(str(caught.value)) < 600


@pytest.mark.parametrize("name", hostile.JSONS)
def test_hostile_json_is_refused(name, tmp_path):
    path = tmp_path / "f.json"
    path.write_text(hostile.JSONS[name])
    tracemalloc.start()
    with pytest.raises(RotcliError):
        found = read_result(str(path), "calibration")
        from rotcli.results.calibration import read_correction

        assert found
        read_correction(str(path))
    tracemalloc.stop()


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null"])
def test_a_device_is_no_log(rotcli, device):
    done = rotcli("allan", device)
    assert done.status == 1
    assert "a pipe or device, not a file" in done.err
    assert rotcli("report", "/dev/zero").status == 1


@pytest.mark.parametrize("name", hostile.ODD_NAMES)
def test_odd_paths_work_and_print_as_text(name, rotcli, tmp_path):
    folder = tmp_path / name
    try:
        shutil.copytree(FIXTURES / "nav440_rate_60", folder)
    except OSError:
        pytest.skip("this file system does not take the name")
    out = folder / "c.json"
    done = rotcli("calibrate", folder / "imu.parquet", folder / "table.parquet", "-o", out)
    assert done.status == 0
    assert json.loads(out.read_text())["inputs"][0]["path"] == str(folder / "imu.parquet")
    link = tmp_path / "link.json"
    link.symlink_to(out)
    for suffix in ("md", "html", "tex", "csv", "txt"):
        page = folder / f"r.{suffix}"
        assert rotcli("report", link, "-o", folder / ".." / name / page.name).status == 0
        text = page.read_text()
        if suffix in ("md", "html"):
            assert "<script>" not in text
        if suffix == "tex":
            assert "\\input{" not in text
    assert not (Path.cwd() / "pwned").exists()
    assert sorted(p.name for p in folder.iterdir()) == sorted(
        [*("imu.parquet", "table.parquet", "rig.toml", "truth.json", "c.json")]
        + [f"r.{s}" for s in ("md", "html", "tex", "csv", "txt")]
    )


def test_everything_a_file_says_is_escaped(rotcli, tmp_path):
    bad = "<script>alert('x')</script> \\input{/etc/passwd} | `a` **b** $x$ % & _ # ~ ^ \n|"
    shutil.copytree(FIXTURES / "nav440_rate_60", tmp_path / "run")
    out = tmp_path / "c.json"
    logs = (tmp_path / "run" / "imu.parquet", tmp_path / "run" / "table.parquet")
    assert rotcli("calibrate", *logs, "-o", out).status == 0
    doc = json.loads(out.read_text())
    doc["rig"]["imu"]["name"] = bad
    doc["rig"]["imu"]["columns"] = {"gyro_x": bad}
    doc["inputs"][0]["path"] = doc["inputs"][0]["sha256"] = doc["rotcli"] = bad
    doc["warnings"] = [bad]
    doc["parameters"]["bias_x"]["unit"] = bad
    out.write_text(json.dumps(doc))
    for suffix in ("md", "html", "tex"):
        page = tmp_path / f"r.{suffix}"
        assert rotcli("report", out, "-o", page).status == 0
        text = page.read_text()
        assert "<script" not in text or suffix == "tex"
        if suffix == "tex":  # what stands in a comment ends with its line
            body = "\n".join(line for line in text.splitlines() if not line.startswith("%"))
            assert "\\input" not in body
        if suffix == "md":
            assert not re.search(r"(?<!\\)`a`|(?<!\\)\*\*b", text)


def linked(link, target):
    link.unlink(missing_ok=True)
    link.symlink_to(target)
    return link


OUTPUTS = {
    "calibrate": (["{imu}", "{table}"], ["-o", "--report-residuals"]),
    "navigate": (["{imu}", "{table}"], ["-o", "--solution", "--plot"]),
    "observe": (["{imu}", "{table}"], ["-o", "--solution", "--plot", "--save-calibration"]),
    "allan": (["{imu}"], ["-o", "--plot"]),
    "convert": (["{imu}"], ["-o"]),
}


@pytest.mark.parametrize("command", OUTPUTS)
def test_an_output_that_is_an_input_is_refused(command, rotcli, turning, tmp_path):
    arguments, options = OUTPUTS[command]
    held = {"imu": turning / "imu.parquet", "table": turning / "table.parquet"}
    link = tmp_path / "link.parquet"
    link.symlink_to(held["imu"])
    before = {p: p.read_bytes() for p in turning.iterdir()}
    for option in options:
        for target in (held["imu"], link, turning / ".." / "turning" / "rig.toml"):
            if option == "-o" and command != "convert":  # another suffix is refused as such
                target = linked(tmp_path / f"{target.stem}.json", target)
            args = [a.format(**held) for a in arguments]
            done = rotcli(command, *args, option, target)
            assert done.status == 2, done
            assert "would replace the input" in done.err
    assert {p: p.read_bytes() for p in turning.iterdir()} == before


def test_two_outputs_in_one_file_and_a_report_over_its_result_are_refused(rotcli, turning):
    logs = (turning / "imu.parquet", turning / "table.parquet")
    same = turning / "same.json"
    done = rotcli("calibrate", *logs, "-o", same, "--report-residuals", same)
    assert "would replace what -o writes" in done.err
    rig = turning / "rig.toml"
    same_rig = linked(turning / "same_rig.json", rig)
    assert "would replace the input" in rotcli("budget", "--rig", rig, "-o", same_rig).err
    result = turning / "r.md"
    result.write_text("{}")
    assert "would replace the input" in rotcli("report", result, "-o", result).err


def test_a_simulation_does_not_replace_a_recording(rotcli, tmp_path):
    log = tmp_path / "imu.parquet"
    log.write_text("a day at the table")
    line = ["simulate", "--imu", "nav440", "--rate", "10", "--static", "2", "--rotation", "2"]
    line += ["--navigation", "0", "-o", tmp_path]
    done = rotcli(*line)
    assert done.status == 1
    assert "is there and not of a simulation" in done.err
    assert log.read_text() == "a day at the table"
    log.unlink()
    assert rotcli(*line).status == 0
    assert rotcli(*line).status == 0  # its own it may
    scenario = tmp_path / "rig.toml"
    assert rotcli("simulate", "--scenario", scenario, "-o", tmp_path).status == 2


FORBIDDEN = (
    r"allow_pickle",
    r"\beval\(",
    r"\bexec\(",
    r"\byaml\b",
    r"\bpickle\b",
    r"shell\s*=\s*True",
    r"os\.system",
    r"\bmarshal\b",
    r"\bshelve\b",
    r"extractall",
)


def test_nothing_in_the_package_runs_what_a_file_says():
    for path in Path(package.__file__).parent.rglob("*.py"):
        text = path.read_text()
        for pattern in FORBIDDEN:
            assert not re.search(pattern, text), f"{path}: {pattern}"


CRASHERS = [p for p in sorted(readers.CRASHERS.glob("*/*")) if p.parent.name in readers.READERS]


@pytest.mark.parametrize("path", CRASHERS, ids=lambda p: f"{p.parent.name}-{p.name}")
def test_what_once_crashed_a_reader_does_not_again(path):
    readers.READERS[path.parent.name](path.read_bytes())


@pytest.mark.parametrize("reader", readers.READERS)
def test_every_reader_takes_the_seeds_of_its_fuzzing(reader):
    for seed in readers.seeds(reader):
        readers.READERS[reader](seed)
