import inspect
import re
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from click.testing import CliRunner

from rotcli.cli.sharing.report import command

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def results(documents, tmp_path_factory):
    docs = documents.small_campaign("NAV_440 \\input{x} 50% & <b> $5$ #1 |")
    docs[2]["warnings"] = ["a gap\nof 2 samples"]
    return documents.write(tmp_path_factory.mktemp("results"), *docs)


def run(*args):
    # Before click 8.2 standard error is mixed into the output unless asked for.
    mixes = "mix_stderr" in inspect.signature(CliRunner).parameters
    runner = CliRunner(**{"mix_stderr": False} if mixes else {})
    return runner.invoke(command, [str(arg) for arg in args])


def test_without_output_tables_and_warnings_go_to_standard_output(results):
    done = run(*results)
    assert done.exit_code == 0
    assert "Conventional navigation, RMS errors" in done.stdout
    assert "Mean gyro output after calibration" in done.stdout
    assert "a gap of 2 samples" in done.stdout
    assert done.stderr == ""
    assert run(*results, "-o", "-").stdout == done.stdout


def test_every_format_is_written_the_same_twice_and_said_on_standard_error(results, tmp_path):
    for suffix in ("md", "html", "tex", "csv", "txt"):
        path = tmp_path / f"report.{suffix}"
        done = run(*results, "-o", path)
        assert done.exit_code == 0
        assert done.stdout == ""
        assert f"{path}: report on 10 results" in done.stderr
        assert "rotcli: warning: " in done.stderr
        first = path.read_bytes()
        assert run(*reversed(results), "-o", path, "--quiet").output == ""
        assert path.read_bytes() == first


def test_latex_is_a_booktabs_table_with_every_sign_escaped(results, tmp_path):
    path = tmp_path / "report.tex"
    run(*results, "-o", path)
    text = path.read_text()
    assert text.splitlines()[0].startswith("% ")
    assert "\\usepackage{booktabs,siunitx,graphicx}" in text.splitlines()[0]
    body = "\n".join(line for line in text.splitlines() if not line.startswith("%"))
    floats = body.count("\\begin{table")
    assert floats == body.count("\\end{table") > 5
    assert body.count("\\toprule") == body.count("\\bottomrule") == floats
    labels = re.findall(r"\\label\{(tab:[a-z0-9-]+)\}", body)
    assert len(set(labels)) == len(labels) == floats
    assert "\\input" not in body
    assert "\\textbackslash{}input\\{x\\}" in body
    assert not re.search(r"(?<!\\)[%$#_]", body)
    for spec, rows in re.findall(
        r"\\begin\{tabular\}\{@\{\}(.*?)@\{\}\}(.*?)\\end\{tabular\}", body, re.S
    ):
        for line in rows.splitlines():
            if line.endswith("\\\\"):
                assert len(re.findall(r"(?<!\\)&", line)) == len(spec.split()) - 1
    bare = re.sub(r"\\[{}]", "", body)
    assert bare.count("{") == bare.count("}")


def test_markdown_has_one_top_heading_and_tables_of_equal_width(results, tmp_path):
    path = tmp_path / "report.md"
    run(*results, "-o", path, "--title", "My # campaign")
    lines = path.read_text().splitlines()
    assert [line for line in lines if line.startswith("# ")] == ["# My # campaign"]
    widths = []
    for line in lines:
        if line.startswith("|"):
            widths.append(len(re.findall(r"(?<!\\)\|", line)))
        elif widths:
            assert len(set(widths)) == 1
            widths = []


def test_csv_keeps_numbers_at_full_precision(documents, tmp_path):
    third = documents.navigation("B", "full", 10.0, 1.0 / 3.0, 0.0)
    paths = documents.write(tmp_path, third, documents.navigation("B", "full", 20.0, 1.0, 0.0))
    run(*paths, "-o", tmp_path / "r.csv")
    frame = pd.read_csv(tmp_path / "r.csv")
    assert (frame["value"] == 1.0 / 3.0).any()


def test_an_unknown_suffix_is_a_usage_error_that_names_the_known_ones(results, tmp_path):
    for name in ("report.docx", "report"):
        done = run(*results, "-o", tmp_path / name)
        assert done.exit_code == 2
        assert "known: .md, .html, .tex, .csv, .xlsx, .parquet, .txt, or a folder" in done.stderr
    assert run().exit_code == 2
    assert run(*results, "--solution", "a.parquet").exit_code == 2


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "not a result file"),
        ('{"kind": "weather", "schema": 1}', "no table for results of kind 'weather'"),
        ('{"kind": "navigation", "schema": 1}', "mode: None is none of"),
        ('{"kind": "navigation", "schema": 9}', "schema 9 is not known"),
        (None, "cannot be read: No such file"),
    ],
)
def test_bad_input_is_one_line_exit_1_and_the_older_report_stays(results, tmp_path, content, said):
    bad, out = tmp_path / "bad.json", tmp_path / "report.md"
    out.write_text("older")
    if content is not None:
        bad.write_text(content)
    done = subprocess.run(
        [sys.executable, "-m", "rotcli", "report", *results, str(bad), "-o", str(out)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert re.fullmatch(r"rotcli: error: [^\n]*bad\.json: [^\n]*\n", done.stderr)
    assert said in done.stderr
    assert out.read_text() == "older"
    assert done.stdout == ""


def test_only_a_page_loads_matplotlib_and_jinja2(results, tmp_path):
    program = (
        "import sys\n"
        "from rotcli.cli.sharing.report import command\n"
        "heavy = ('matplotlib', 'jinja2', 'pandas', 'scipy', 'pyarrow')\n"
        "command.main(sys.argv[1:], standalone_mode=False)\n"
        "sys.exit(','.join(name for name in heavy if name in sys.modules))\n"
    )
    for suffix in ("md", "tex", "txt"):
        out = str(tmp_path / f"r.{suffix}")
        done = subprocess.run(
            [sys.executable, "-c", program, *results, "--quiet", "-o", out],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.stderr.strip() == ""


def test_a_solution_is_drawn_in_the_page(results, tmp_path):
    import numpy as np

    from rotcli.files.columns import write_columns
    from rotcli.navigate.plot import ERROR_COLUMNS

    write_columns(tmp_path / "nav.parquet", {name: np.arange(9.0) for name in ERROR_COLUMNS})
    done = run(results[0], "-o", tmp_path / "r.html", "--solution", tmp_path / "nav.parquet")
    assert done.exit_code == 0
    assert "Errors against time" in (tmp_path / "r.html").read_text()


def test_a_file_given_twice_is_remarked_on_standard_error_only(documents, tmp_path):
    doc = documents.navigation("B", "full", 10.0, 3.0, 4.0)
    paths = documents.write(tmp_path, doc, doc)
    done = run(*paths)
    assert f"rotcli: warning: {paths[1]}: the same result as {paths[0]}" in done.stderr
    assert "the same result" not in done.stdout
    assert run(*paths, "--quiet").stderr == ""
