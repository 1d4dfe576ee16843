"""`rotcli fleet` and `rotcli simulate --fleet` through the command line."""

import json

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
        run("fleet", str(folder), "--scheduler", "processes").stdout
        == run("fleet", str(folder)).stdout
    )


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
