"""One long table of a report: rectangular, with units, and complete."""

import io
import zipfile

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from rotcli.cli.sharing.report import command
from rotcli.files.tables import Estimate, Table
from rotcli.files.tables.markup import to_markdown
from rotcli.files.tables.model import KEYS
from rotcli.files.tables.save import csv_text
from rotcli.files.tables.tidy import COLUMNS, Roles, split_unit
from rotcli.report.render import as_frame
from rotcli.report.report import gather
from tests.cli.in_process import run as run_main


@pytest.fixture(scope="module")
def results(documents, tmp_path_factory):
    docs = [*documents.small_campaign("NAV440"), documents.allan("NAV440")]
    docs[-1]["axes"]["gyro_y"]["coefficients"]["quantization"]["upper"] = 0.65
    docs.append(documents.navigation("NAV440", "full", 40.0, 3, 4, warnings=['a gap, "of" 2']))
    for doc in docs:
        doc["unit"] = {"serial": "00017", "date": "2026-11-28", "operator": "=1+1"}
    return documents.write(tmp_path_factory.mktemp("results"), *docs)


@pytest.fixture(scope="module")
def report(results):
    return gather(results, "t", published=True)


@pytest.fixture(scope="module")
def frame(report):
    """The table as a reader of the CSV gets it."""
    text = csv_text(as_frame(report))
    return pd.read_csv(io.StringIO(text), dtype={"serial": str}, keep_default_na=False,
                       na_values={"rate": [""], "value": [""], "sigma": [""]})  # fmt: skip


def test_pandas_reads_one_rectangular_table_with_units(report, results):
    text = csv_text(as_frame(report))
    plain = pd.read_csv(io.StringIO(text))
    assert list(plain.columns) == list(COLUMNS)
    assert plain["value"].dtype == np.float64
    assert plain["sigma"].dtype == np.float64
    assert len(plain) == text.count("\n") - 1
    position = plain[plain["quantity"] == "horizontal position"]
    assert set(position["unit of measure"]) == {"m"}
    bias = plain[(plain["table"] == "Calibrated parameters") & (plain["quantity"] == "bias_x")]
    assert set(bias["unit of measure"]) == {"deg/h"}
    assert bias["sigma"].notna().all()
    assert bias["source file"].isin(results).all()
    assert sorted(bias["rate"]) == [10.0, 20.0]


def rebuilt(frame: pd.DataFrame, table: Table) -> Table:
    """Return a table from the lines of the long one; only its columns are known."""
    roles = Roles(table)
    lines = frame[frame["table"] == table.title]
    rows = []
    for number in range(1, int(lines["row"].max()) + 1):
        own = lines[lines["row"] == number]
        cells = [None] * len(table.columns)
        for k in roles.keys:
            # A column with a unit in its heading says nothing of the row's unit.
            bare = [not split_unit(column)[1] for column in own["column"]]
            name = KEYS[table.headings[k]]
            cell = (own[bare] if name == "unit of measure" else own).iloc[0][name]
            cells[k] = None if cell in ("",) or pd.isna(cell) else cell
        for _, line in own.iterrows():
            for k, sigma in roles.values:
                if line["column"] != table.headings[k]:
                    continue
                value = None if pd.isna(line["value"]) else line["value"]
                error = None if pd.isna(line["sigma"]) else line["sigma"]
                if line["text"] == "95 % upper limit":
                    cells[k] = Estimate(None, None, value)
                elif sigma is None and error is not None:
                    cells[k] = Estimate(value, error)
                else:
                    integer = table.columns[k].format == "d"
                    cells[k] = int(value) if integer and value is not None else value
                if sigma is not None:
                    cells[sigma] = error
            for k in roles.texts:
                if line["column"] == table.headings[k]:
                    cells[k] = line["text"]
        if roles.items:
            first = own[own["column"].isin([table.headings[k] for k, _ in roles.values])].iloc[0]
            item = first["quantity"].removesuffix(f", {split_unit(first['column'])[0]}")
            unit = first["unit of measure"]
            bare = split_unit(first["column"])[1] == "" and "unit" not in table.headings
            style = (
                "{} ({})"
                if any(str(r[roles.items[0]]).endswith(")") for r in table.rows)
                else "{}, {}"
            )
            named = style.format(item, unit) if bare and unit else item
            several = named.split(", ", len(roles.items) - 1) if len(roles.items) > 1 else [named]
            for k, name in zip(roles.items, several, strict=True):
                cells[k] = name
        rows.append(tuple(cells))
    return Table(table.title, table.columns, rows, table.note)


def test_every_table_can_be_put_together_again(report, frame):
    assert len(report.tables) > 8
    for table in report.tables:
        assert to_markdown(rebuilt(frame, table)) == to_markdown(table), table.title


@pytest.fixture(scope="module")
def laboratory(tmp_path_factory):
    """Results of a plan and of simulated logs: triad, scale, thermal."""
    folder = tmp_path_factory.mktemp("laboratory")
    made = [str(folder / "plan.json")]
    commands = [("plan", "--table", "1", "--minutes", "4", "-o", made[0])]
    for name, options in {
        "triad": ("--sequence", "M5", "--imu", "nav440"),
        "scale": ("--scenario", "scale-test"),
        "thermal": ("--scenario", "thermal-test"),
    }.items():
        logs = (f"{folder}/{name}/imu.parquet", f"{folder}/{name}/table.parquet")
        made.append(f"{folder}/{name}.json")
        commands.append(("simulate", *options, "--seed", "1", "-o", f"{folder}/{name}"))
        commands.append((name, *logs, "-o", made[-1]))
    for command_line in commands:
        assert run_main(*command_line, "--quiet").returncode == 0, command_line
    return made


def test_tables_of_the_laboratory_have_units_and_can_be_put_together_again(laboratory):
    report = gather(laboratory, "t")
    frame = pd.read_csv(io.StringIO(csv_text(as_frame(report))), dtype={"serial": str},
                        keep_default_na=False,
                        na_values={"rate": [""], "value": [""], "sigma": [""]})  # fmt: skip
    for table in report.tables:
        assert to_markdown(rebuilt(frame, table)) == to_markdown(table), table.title
    bare = frame[(frame["unit of measure"] == "") & frame["value"].notna()]
    figures = {name.split(", ")[-1] for name in bare["quantity"]}
    assert figures <= {
        "count", "chi2", "dof", "gyro chi2", "accel chi2", "chi2/n", "p", "order", "n",
        "D-efficiency of the plan", "plan", "positions",
    }  # fmt: skip
    curve = frame[frame["quantity"] == "curve"]
    assert set(curve["unit of measure"]) == {"deg/h"}
    assert {-100.0, 0.0, 100.0} <= set(curve["rate"].round(3))
    assert set(frame.loc[frame["quantity"] == "Kgxy", "axis"]) == {""}


def test_serial_date_and_files_are_those_of_the_results(frame, results):
    assert set(frame.loc[frame["table"] == "Calibrated parameters", "serial"]) == {"00017"}
    assert set(frame.loc[frame["quantity"] == "bias_x", "date"]) == {"2026-11-28"}
    means = frame[frame["table"].str.startswith("RMS errors for each mode")]
    turning = means[(means["mode"] == "full") & (means["rate"] == 10.0)]
    (files,) = set(turning["source file"])
    assert set(files.split("; ")) <= set(results)
    still = means[means["mode"] == "conventional"]
    assert still.iloc[0]["source file"].count(".json") == 2


def run(*args):
    return CliRunner().invoke(command, [str(arg) for arg in args])


def test_parquet_and_excel_contain_the_same_values(results, frame, tmp_path):
    for suffix in ("parquet", "xlsx"):
        path = tmp_path / f"r.{suffix}"
        assert run(*results, "--published", "-o", path, "--quiet").exit_code == 0
        first = path.read_bytes()
        assert run(*reversed(results), "--published", "-o", path, "--quiet").exit_code == 0
        assert path.read_bytes() == first
    parquet = pq.read_table(tmp_path / "r.parquet").to_pandas()
    excel = pd.read_excel(tmp_path / "r.xlsx", sheet_name=None, dtype={"serial": str})
    for other in (parquet, excel["data"]):
        assert list(other.columns) == list(COLUMNS)
        # The quick parser of pandas 2.1 is off by 1e-14 of a number with 16 digits.
        assert np.allclose(other["value"], frame["value"], rtol=1e-13, atol=0.0, equal_nan=True)
    sheet = excel["calibrated-parameters"]
    assert {"bias_x, deg/h", "sigma bias_x, deg/h"} < set(sheet.columns)
    with zipfile.ZipFile(tmp_path / "r.xlsx") as book:
        assert {info.date_time[0] for info in book.infolist()} == {1980}


def test_a_folder_gets_a_csv_for_each_table(results, report, tmp_path):
    done = run(*results, "--published", "-o", f"{tmp_path}/tables/")
    assert done.exit_code == 0
    files = sorted((tmp_path / "tables").iterdir())
    assert len(files) == len(report.tables)
    read = pd.read_csv(tmp_path / "tables" / "calibrated-parameters.csv")
    assert {"IMU", "rate, deg/s", "bias_x, deg/h", "sigma bias_x, deg/h"} < set(read.columns)
    assert len(read) == 2


def test_a_cell_that_a_spreadsheet_would_compute_is_quoted(documents, tmp_path):
    doc = documents.navigation("=cmd()", "full", 10.0, 1.0, 0.0)
    paths = documents.write(tmp_path, doc, documents.navigation("=cmd()", "full", 20.0, 1.0, 0.0))
    run(*paths, "-o", tmp_path / "r.csv", "--quiet")
    frame = pd.read_csv(tmp_path / "r.csv")
    assert set(frame["unit"].dropna()) == {"'=cmd()"}


def test_folders_and_patterns_are_results_too(results, tmp_path):
    folder = str(results[0]).rsplit("/", 1)[0]
    named = run(*results).stdout
    assert run(folder).stdout == named
    assert run(f"{folder}/*.json").stdout == named
    assert run(f"{folder}/none*.json").exit_code == 1
