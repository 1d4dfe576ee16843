"""`rotcli certificate` through the command line."""

import json

import pytest

from tests.certificate import documents as docs
from tests.cli.in_process import run


@pytest.fixture
def results(tmp_path):
    paths = []
    for name, doc in (("triad", docs.triad()), ("allan", docs.allan())):
        path = tmp_path / f"{name}.json"
        path.write_text(json.dumps(doc))
        paths.append(str(path))
    return paths


def test_html_and_markdown_are_written_and_reproducible(results, tmp_path) -> None:
    for suffix in ("html", "md"):
        target, again = tmp_path / f"a.{suffix}", tmp_path / f"b.{suffix}"
        done = run("certificate", *results, "-o", str(target))
        assert done.returncode == 0, done.stderr
        assert "certificate of SN0001" in done.stderr
        run("certificate", *results, "-o", str(again))
        assert target.read_bytes() == again.read_bytes()


def test_standard_output_is_markdown(results) -> None:
    done = run("certificate", *results, "--title", "Sheet")
    assert done.stdout.startswith("# Sheet\n")


def test_a_spec_gives_a_verdict(results, tmp_path) -> None:
    spec = tmp_path / "spec.toml"
    spec.write_text("[limits]\nbias_y = { min = -80, max = 80, unit = 'deg/h' }\n")
    done = run("certificate", *results, "--spec", str(spec), "-o", str(tmp_path / "c.html"))
    assert done.stderr == f"rotcli: {tmp_path}/c.html: certificate of SN0001, fail\n"


def test_bad_input_is_one_line_and_leaves_no_file(results, tmp_path) -> None:
    bad, target = tmp_path / "bad.json", tmp_path / "c.html"
    bad.write_text('{"kind": "navigation", "schema": 1}')
    done = run("certificate", str(bad), "-o", str(target))
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "has no place in a certificate" in done.stderr
    assert not target.exists()
    assert run("certificate", *results, "-o", str(tmp_path / "c.docx")).returncode == 2
    assert run("certificate", *results, "--fleet", results[0]).returncode == 1


def test_a_parameter_without_sigma_is_named(tmp_path) -> None:
    doc = docs.triad()
    doc["parameters"]["bias_y"]["sigma"] = None
    path = tmp_path / "triad.json"
    path.write_text(json.dumps(doc))
    done = run("certificate", str(path))
    assert done.returncode == 0
    assert done.stderr == (
        "rotcli: warning: bias_y: no sigma in the results, no uncertainty is stated\n"
    )
