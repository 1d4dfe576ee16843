"""Hostile files are refused in one line, or shown letter by letter."""

import json
import os
import re
import shutil
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import pytest

import rotcli as package
from rotcli.errors import RotcliError
from rotcli.files.results.documents import read_result
from rotcli.report import render, report
from rotcli.report.page import as_html
from rotcli.rig.profile import read_profile
from rotcli.rig.rig import read_rig
from rotcli.rig.scenario import read_scenario
from tests.campaigns.faults import hostile, hostile_logs, runs
from tests.campaigns.fuzz import readers
from tests.conftest import FIXTURES


@pytest.fixture
def call(rotcli):
    """Return a function that runs a command line in this process."""

    def run(args):
        done = rotcli(*args)
        return SimpleNamespace(returncode=done.status, stderr=done.err)

    return run


_SLOW = {"a Parquet of 3e7 equal records", "a Parquet of 3e7 records beyond the limit"}
LOGS = [
    pytest.param(name, marks=pytest.mark.campaign if name in _SLOW else ())
    for name in hostile_logs.LOGS
]


@pytest.mark.parametrize("name", LOGS)
def test_a_hostile_log_is_refused_in_one_line(name, call, tmp_path):
    log = hostile_logs.LOGS[name]
    assert hostile.refused(log, tmp_path / "log" / f"imu{log.suffix}", call) is None


@pytest.mark.parametrize("name", ["a CSV bomb, gzip", "a Parquet footer of 2 GB", "a device"])
def test_a_hostile_log_takes_no_more_memory_than_may_be_read(name, tmp_path):
    log = hostile_logs.LOGS[name]
    assert hostile.within_memory(log, tmp_path / "log" / f"imu{log.suffix}") is None


@pytest.mark.parametrize("name", hostile_logs.SOUND)
def test_an_odd_but_sound_log_means_what_the_plain_one_does(name, call, tmp_path):
    suffix, make = hostile_logs.SOUND[name]
    assert hostile.understood(make, tmp_path / "log" / f"imu{suffix}", call) is None


def test_the_limit_can_be_raised(rotcli, tmp_path):
    log = FIXTURES / "nav440_still" / "imu.csv"
    assert "raise the limit (option: --max-bytes)" in rotcli("allan", log, "--max-bytes", "10k").err
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
        from rotcli.run.correction import read_correction

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


@pytest.mark.parametrize(
    "world",
    [{"PYTHONIOENCODING": "ascii"}, {"PYTHONIOENCODING": "cp1252"}],
    ids=["ascii", "cp1252"],
)
def test_a_name_that_the_terminal_cannot_show_stops_nothing(world, tmp_path):
    folder = tmp_path / "日本é"
    shutil.copytree(FIXTURES / "nav440_rate_60", folder)
    logs = [str(folder / "imu.parquet"), str(folder / "table.parquet")]
    done = runs.rotcli(["calibrate", *logs, "-o", "-"], env=world)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["kind"] == "calibration"  # UTF-8, whatever the locale
    done = runs.rotcli(["allan", str(tmp_path / "日本.csv")], env=world)
    assert done.returncode == 1
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("rotcli: error: ")
    assert "cannot be read: No such file" in done.stderr


def test_a_path_that_is_no_text_is_refused_in_one_line(tmp_path):
    folder = tmp_path / os.fsdecode(b"\xff")
    shutil.copytree(FIXTURES / "nav440_rate_60", folder)
    plain = {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    for world in ({}, plain):
        done = runs.rotcli(["allan", str(folder / "imu.parquet")], env=world)
        assert done.returncode == 1
        assert done.stderr.count("\n") == 1
        assert "the path is not UTF-8 text; rename" in done.stderr
    line = ["budget", "--imu", "nav440", "--rate", "10", "--rig", str(folder / "rig.toml"), "-o"]
    # Processes, too: what is printed is not text that a worker of pytest-xdist could send.
    assert runs.rotcli([*line, str(folder / "b.json")]).returncode == 0
    made = runs.rotcli(["report", str(folder / "b.json"), "-o", str(folder / "r.html")])
    assert made.returncode == 0
    assert "Traceback" not in made.stderr


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
    doc["residual_rms"]["x"]["unit"] = bad
    out.write_text(json.dumps(doc))
    for suffix in ("md", "html", "tex"):
        page = tmp_path / f"r.{suffix}"
        assert rotcli("report", out, "-o", page).status == 0
        text = page.read_text()
        assert "<script" not in text or suffix == "tex"
        if suffix == "tex":  # a comment ends with its line
            body = "\n".join(line for line in text.splitlines() if not line.startswith("%"))
            assert "\\input" not in body
        if suffix == "md":
            assert not re.search(r"(?<!\\)`a`|(?<!\\)\*\*b", text)


BAD = "<script>alert('x')</script> \\input{/etc/passwd} | `a` $\\nix{$ % & _ # ~ ^"


def leaves(value, path=()):
    """Yield the places of a document's texts, of a list's elements the first two."""
    if isinstance(value, str):
        yield path
    elif isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value[:2])
        for key, item in items:
            yield from leaves(item, (*path, key))


def put(doc, path):
    *above, last = path
    for key in above:
        doc = doc[key]
    doc[last] = BAD


@pytest.mark.parametrize("number", range(len(readers.result_documents())))
def test_every_text_of_every_kind_of_result_is_escaped(number, tmp_path):
    doc = readers.result_documents()[number]
    path, places, shown = tmp_path / "r.json", {}, []
    for place in leaves(doc):
        if place != ("kind",):
            places.setdefault(tuple("#" if isinstance(k, int) else k for k in place), place)
    for place in places.values():
        bad = json.loads(json.dumps(doc))
        put(bad, place)
        path.write_text(json.dumps(bad))
        try:
            found = report.gather([str(path)], BAD)
            markdown, latex = render.as_markdown(found), render.as_latex(found)
        except RotcliError:
            continue  # a text that must be one of some
        shown.append(place)
        assert "<script" not in markdown, place
        body = [line for line in latex.splitlines() if not line.lstrip().startswith("%")]
        assert "\\input" not in "\n".join(body), place
    assert len(shown) > 2
    for place in shown:  # all at once in the page, which draws figures, too
        put(doc := json.loads(json.dumps(doc)), place)
    path.write_text(json.dumps(doc))
    page = as_html(report.gather([str(path)], BAD), [])
    assert "alert" in page
    assert "<script" not in page


FORBIDDEN = (
    r"allow_pickle",
    r"\beval\(",
    r"\bexec\(",
    r"\bimport yaml\b",
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
