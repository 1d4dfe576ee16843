"""`rotcli fleet` and `rotcli simulate --fleet` through the command line."""

import json
import os
from concurrent.futures import BrokenExecutor, ThreadPoolExecutor

import pandas as pd
import pytest

from tests.cli.in_process import run

ONE = ("--parameter", "bias_z")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("cli") / "fleet"
    done = run("simulate", "--fleet", "5,6,2", "--seed", "3", "-o", str(path))
    assert done.returncode == 0, done.stderr
    return path


def test_a_folder_gives_document_page_and_table(folder, tmp_path) -> None:
    out = {name: str(tmp_path / f"x.{name}") for name in ("json", "html", "csv")}
    done = run("fleet", str(folder), *ONE, "-o", out["json"], "--page", out["html"])
    assert done.returncode == 0, done.stderr
    done = run("fleet", str(folder), *ONE, "--table", out["csv"], "--quiet")
    assert done.returncode == 0, done.stderr
    doc = json.loads((tmp_path / "x.json").read_text())
    assert (doc["kind"], doc["results"], doc["units"]) == ("fleet", 60, 5)
    assert len(pd.read_csv(out["csv"])) == 60
    report = run("report", out["json"])
    assert "60 results of 5 units" in report.stdout
    assert "<svg" in (tmp_path / "x.html").read_text()


def test_a_data_set_grows_by_new_results_only(folder, tmp_path) -> None:
    data = str(tmp_path / "data")
    done = run("fleet", str(folder / "SN0001"), str(folder / "SN0002"), "--dataset", data, *ONE)
    assert "24 new results" in done.stderr
    done = run("fleet", str(folder), "--dataset", data, *ONE)
    assert "36 new results" in done.stderr
    done = run("fleet", data, *ONE)
    assert done.stdout.startswith("60 results of 5 units")
    assert done.stdout == run("fleet", f"{folder}/**/*.json", *ONE).stdout


def test_processes_give_the_same_result(folder) -> None:
    assert (
        run("fleet", str(folder), *ONE, "--scheduler", "processes").stdout
        == run("fleet", str(folder), *ONE).stdout
    )


def test_many_results_are_read_in_processes(folder, monkeypatch) -> None:
    started = []

    class Pool(ThreadPoolExecutor):
        def __init__(self) -> None:
            started.append(self)
            super().__init__()

    monkeypatch.setattr("concurrent.futures.ProcessPoolExecutor", Pool)
    few = run("fleet", str(folder), *ONE).stdout
    assert not started
    monkeypatch.setattr("rotcli.cli.sharing.fleet.MANY_RESULTS", 1)
    assert run("fleet", str(folder), *ONE).stdout == few
    assert len(started) == 1


def test_a_killed_process_costs_no_result(folder, monkeypatch) -> None:
    class Pool(ThreadPoolExecutor):
        def map(self, *_):
            raise BrokenExecutor

    complete = run("fleet", str(folder), *ONE).stdout
    monkeypatch.setattr("concurrent.futures.ProcessPoolExecutor", Pool)
    done = run("fleet", str(folder), *ONE, "--scheduler", "processes")
    assert (done.returncode, done.stdout) == (0, complete)
    assert "a reading process was killed" in done.stderr


@pytest.mark.filterwarnings("default")  # Dask's own
def test_a_dask_cluster_gives_the_same_result(folder) -> None:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        address = cluster.scheduler_address
        done = run("fleet", str(folder), *ONE, "--scheduler", address)
    assert done.returncode == 0, done.stderr
    assert done.stdout == run("fleet", str(folder), *ONE).stdout


def test_bad_input_is_one_line(folder, tmp_path) -> None:
    bad = tmp_path / "bad.json"
    bad.write_text('{"kind": "calibration", "schema": 9}')
    done = run("fleet", str(bad))
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "schema 9" in done.stderr
    done = run("fleet", str(folder), str(tmp_path), "--parameter", "bias_z")
    assert done.returncode == 0
    assert "schema 9" in done.stderr
    assert run("fleet", str(folder), "--parameter", "nothing").returncode == 1
    assert run("fleet", str(tmp_path / "none")).returncode == 1
    assert run("fleet", str(folder), "--default-sigma", "bias_z").returncode == 2
    assert run("fleet", str(folder), "--page", "x.pdf").returncode == 2


def test_a_simulated_fleet_replaces_no_other_folder(tmp_path) -> None:
    (tmp_path / "mine.txt").write_text("x")
    done = run("simulate", "--fleet", "2,2,2", "-o", str(tmp_path))
    assert done.returncode == 1
    assert "was not written by rotcli simulate" in done.stderr
    assert run("simulate", "--fleet", "2,2", "-o", str(tmp_path / "a")).returncode == 2
    done = run("simulate", "--fleet", "2,2,2", "--rate", "3", "-o", str(tmp_path / "a"))
    assert done.returncode == 2
    assert "--rate: --fleet makes results" in done.stderr


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"sigma": ', '"sigma": -1, "s": ', ".sigma: -1: must be"),
        ('"sigma": ', '"sigma": NaN, "s": ', "NaN is no number of a result"),
        ('"unit": "deg/h"', '"unit": "deg/s"', '.unit: "deg/s": must be deg/h'),
        ('"kind": ', '"kind": "x", "kind": ', "kind: this key occurs twice"),
    ],
)
def test_an_edited_result_is_skipped_and_named(folder, tmp_path, old, new, said) -> None:
    edited = tmp_path / "below" / "edited.json"
    edited.parent.mkdir()
    source = next(iter(sorted((folder / "SN0001").rglob("*.json"))))
    edited.write_text(source.read_text().replace(old, new, 1))
    done = run("fleet", str(folder / "SN0002"), str(folder / "SN0003"), str(tmp_path), *ONE)
    assert done.returncode == 0, done.stderr
    assert f"warning: {edited}: " in done.stderr
    assert said in done.stderr
    assert done.stdout.startswith("24 results of 2 units\n")
    done = run("fleet", str(folder / "SN0002"), str(edited), *ONE)  # a file that is named itself
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(f"rotcli: error: {edited}: ")


def test_a_pipe_is_not_waited_for(tmp_path) -> None:
    os.mkfifo(tmp_path / "x.json")
    for source in (tmp_path, tmp_path / "x.json"):
        done = run("fleet", str(source))
        assert done.returncode == 1
        assert "a pipe or device, not a file" in done.stderr


def test_texts_of_results_control_no_terminal_browser_or_spreadsheet(folder, tmp_path) -> None:
    place = tmp_path / "units"
    for k, path in enumerate(sorted((folder / "SN0001").rglob("*.json"))):
        doc = json.loads(path.read_text())
        (doc.get("unit") or doc["rig"]["unit"])["serial"] = "=1+1\x1b]0;p\x07\u202e"
        (place / str(k)).mkdir(parents=True)
        (place / str(k) / path.name).write_text(json.dumps(doc))
    out = {name: tmp_path / f"x.{name}" for name in ("html", "csv")}
    done = run("fleet", str(place), *ONE, "--page", str(out["html"]), "--table", str(out["csv"]))
    assert done.returncode == 0, done.stderr
    texts = [done.stdout, done.stderr, *(path.read_text() for path in out.values())]
    assert not any(sign in text for text in texts for sign in "\x1b\x07\u202e")
    assert set(pd.read_csv(out["csv"])["unit"]) == {"'=1+1\\x1b]0;p\\x07\\u202e"}
