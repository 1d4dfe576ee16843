"""From result files to the fleet's document: scan, data set, estimate, page, and bad inputs."""

import json
import math
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotcli.errors import ResultError, RigError
from rotcli.files.results.find import find_results
from rotcli.files.spec import read_spec
from rotcli.fleet.document import tidy, to_document, turn_on_sigmas
from rotcli.fleet.estimate import FleetOptions, estimate
from rotcli.fleet.page import to_html_page
from rotcli.fleet.records import Folders, days_since_epoch, rows_of
from rotcli.fleet.scan import (
    append_dataset,
    is_dataset,
    read_dataset,
    read_results,
    to_frame,
)
from rotcli.fleet.simulate import PARAMETERS, FleetSize, write_fleet
from rotcli.fleet.tables import one_line_summary, tables
from tests.export import documents
from tests.fleet.fleets import fleet
from tests.report import browser

SIZE = FleetSize(12, 8, 3)
INPUTS = [{"path": "fleet", "results": SIZE.results, "sha256": "0" * 64}]
SPEC = """
[limits]
bias_z = { min = -20, max = 120, unit = "deg/h", guard = 2.0 }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("fleet")
    write_fleet(str(path), SIZE, seed=1)
    return path


def frame_of(*sources: str, folders: Folders = Folders()) -> pd.DataFrame:  # noqa: B008 (frozen)
    paths, named = find_results([str(s) for s in sources])
    return to_frame(read_results([*paths, *named], folders))[0]


@pytest.fixture(scope="module")
def frame(folder):
    return frame_of(folder)


@pytest.fixture(scope="module")
def result(frame):
    return estimate(frame, FleetOptions())


def test_a_simulated_fleet_has_its_components(result) -> None:
    """12 units: the true value lies inside each 95 % interval except for 1 in 20."""
    inside = []
    for p in result.parameters:
        truth = PARAMETERS[p.name]
        for limits, value in zip(
            p.components.intervals, (truth.unit, truth.day, truth.turn_on), strict=True
        ):
            inside.append(limits[0] <= value**2 <= limits[1])
    assert len(inside) == 18
    assert sum(inside) >= 15


def test_rows_have_serial_date_and_time(frame) -> None:
    row = frame.iloc[0]
    assert (row["unit"], row["day"]) == ("SN0001", "2026-01-05")
    assert row["time"] == pytest.approx(days_since_epoch("2026-01-05T08:00:00"))
    assert len(frame) == SIZE.results * len(PARAMETERS)
    assert frame["sha256"].nunique() == SIZE.results


def test_only_new_results_are_appended(folder, frame, tmp_path) -> None:
    first = frame[frame["unit"] < "SN0007"]
    path = str(tmp_path / "data")
    assert append_dataset(path, first) == 6 * 24
    assert is_dataset(path)
    stored = read_dataset(path)
    known = frozenset(stored["sha256"])
    paths, _ = find_results([str(folder)])
    chunk = read_results(paths, Folders(), known)
    assert chunk.skipped == 6 * 24 + 1  # the truth file is no result
    append_dataset(path, to_frame(chunk)[0])
    everything = read_dataset(path)
    merged = everything.merge(frame, on=["sha256", "parameter"], suffixes=("", "_2"))
    assert len(merged) == len(everything) == len(frame)
    assert (merged["value"] == merged["value_2"]).all()


def test_the_same_results_give_the_same_data_set(frame, tmp_path) -> None:
    for name in ("a", "b"):
        append_dataset(str(tmp_path / name), frame)
    one, two = (sorted((tmp_path / name).rglob("*.parquet")) for name in ("a", "b"))
    assert [p.name for p in one] == [p.name for p in two]
    assert all(a.read_bytes() == b.read_bytes() for a, b in zip(one, two, strict=True))


def test_the_document_is_plain_json_and_the_same_every_time(frame, result) -> None:
    doc = to_document(result, INPUTS)
    again = to_document(estimate(frame, FleetOptions()), INPUTS)
    text = json.dumps(doc, allow_nan=False)
    assert text == json.dumps(again, allow_nan=False)
    bias = doc["parameters"]["bias_z"]
    assert bias["components"]["unit"]["lower"] < 30.0 < bias["components"]["unit"]["upper"]
    day_to_day = bias["repeatability"]["day_to_day"]["value"]
    parts = [bias["components"][k]["value"] for k in ("day", "turn_on")]
    assert day_to_day == pytest.approx(math.hypot(*parts))
    assert len(bias["by_unit"]) == 12
    assert "12 units" in one_line_summary(doc)
    assert [t.title for t in tables(doc)] == [
        "288 results of 12 units",
        "Outliers, control charts and trend",
    ]


def test_a_spec_gives_verdicts_and_yield(frame, tmp_path) -> None:
    path = tmp_path / "spec.toml"
    path.write_text(SPEC)
    result = estimate(frame, FleetOptions(parameters=("bias_*",)), read_spec(str(path)))
    assert [p.name for p in result.parameters] == ["bias_x", "bias_y", "bias_z"]
    doc = to_document(result, INPUTS)
    verdicts = [u["verdict"] for u in doc["parameters"]["bias_z"]["by_unit"].values()]
    assert set(verdicts) <= {"pass", "fail", "undecided"}
    assert doc["parameters"]["bias_z"]["yield"]["pass"] == verdicts.count("pass")
    assert doc["parameters"]["bias_x"]["yield"] is None
    estimate(frame, FleetOptions(parameters=("bias_x",)), read_spec(str(path)))  # no error
    assert tables(doc)[-1].title == "Limits and yield"


@pytest.fixture(scope="module")
def page(result):
    result = replace(result, parameters=result.parameters[-1:])
    return to_html_page(result, to_document(result, INPUTS), "A <fleet> & more")


def test_the_page_is_one_valid_file_that_fetches_nothing(result, page) -> None:
    result = replace(result, parameters=result.parameters[-1:])
    doc = to_document(result, INPUTS)
    assert page == to_html_page(result, doc, "A <fleet> & more")
    assert "A &lt;fleet&gt; &amp; more" in page
    assert "<script" not in page
    assert "http" not in page.replace("http-equiv", "").replace("http://www.w3.org", "")
    figures = page.count('<svg class="plot"')
    assert figures >= 2 * len(result.parameters)
    for part in page.split("<figure>")[1:]:
        ET.fromstring(part[: part.index("</svg>") + 6])


@pytest.mark.skipif(browser.browser() is None, reason=browser.WHY_NOT)
def test_text_and_figures_stay_inside_the_page_on_a_phone_and_a_desk(page, tmp_path) -> None:
    phone, desk = browser.measure(tmp_path, page, 390, 1400)
    for view in (phone, desk):
        assert view["overflowing"] == []
        assert view["scroll"] <= view["width"] + 1
        assert view["figures"] >= 2
        assert view["fetched"] == []
    assert not any(table["scrolls"] for table in desk["tables"])


def test_the_tidy_table_has_one_row_per_value(result) -> None:
    table = tidy(result)
    assert len(table) == SIZE.results * len(PARAMETERS)
    assert set(table["unit"].unique()) == {f"SN{k:04d}" for k in range(1, 13)}


def test_an_outlying_unit_and_a_drift_are_flagged_in_document_and_page(frame) -> None:
    bad = frame[frame["parameter"] == "bias_z"].copy()
    bad.loc[bad["unit"] == "SN0003", "value"] += 400.0
    late = (bad["unit"] == "SN0005") & (bad["day"] > "2026-03-15")
    bad.loc[late, "value"] += 80.0
    result = estimate(bad, FleetOptions())
    codes = {(f.code, f.where) for f in result.findings}
    assert {("outlying-unit", "SN0003"), ("ewma-alarm", "SN0005")} <= codes
    doc = to_document(result, INPUTS)
    assert doc["parameters"]["bias_z"]["outliers"]["units"] == ["SN0003"]
    page = to_html_page(result, doc, "Fleet")
    assert "SN0003: 4" in page
    assert "outlying, z = " in page
    assert "EWMA alarm" in page


def test_turn_on_sigmas_of_units_are_unbiased() -> None:
    """Mean of the variances of 200 units with 15 degrees of freedom: 2.6 % per sigma."""
    rows, _ = fleet(9, units=200, days=5, turns=4, s_range=(2.0, 6.0))
    variance = turn_on_sigmas(rows) ** 2
    assert np.mean(variance) == pytest.approx(25.0, rel=0.12)


def write(path, doc) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(doc))
    return str(path)


def calibration(
    serial="A", day="2026-01-05", value=1.0, sigma=1.0, unit="deg/h", name="bias_z", **more
):
    return {
        "kind": "calibration",
        "schema": 1,
        "unit": {"serial": serial, "date": day},
        "parameters": {name: documents.quantity(value, sigma, unit)},
        **more,
    }


def test_units_of_one_kind_are_converted_and_others_refused(tmp_path) -> None:
    """Of a parameter whose unit is no part of the contract of results."""
    for k in range(4):
        write(tmp_path / f"{k}.json", calibration(str(k), value=float(k), name="own"))
    other = {"value": 4.0 / 3600.0, "sigma": 1 / 3600.0, "unit": "deg/s", "name": "own"}
    write(tmp_path / "4.json", calibration("4", **other))
    result = estimate(frame_of(tmp_path), FleetOptions())
    assert result.parameters[0].rows.y + result.parameters[0].rows.centre == pytest.approx(
        [0, 1, 2, 3, 4], abs=1e-12
    )
    bad = write(tmp_path / "5.json", calibration("5", unit="ppm", name="own"))
    with pytest.raises(ResultError, match=f"{bad}: own: unit ppm, but most results are in deg/h"):
        estimate(frame_of(tmp_path), FleetOptions())


def test_values_without_sigma_are_excluded_or_get_the_default(tmp_path) -> None:
    for k in range(5):
        write(tmp_path / f"{k}.json", calibration(str(k), value=float(k), sigma=None if k else 1.0))
    with pytest.raises(ResultError, match="at least 3 are needed"):
        estimate(frame_of(tmp_path), FleetOptions())
    result = estimate(frame_of(tmp_path), FleetOptions(default_sigma={"bias_*": 2.0}))
    assert np.sqrt(result.parameters[0].rows.s2) == pytest.approx([1, 2, 2, 2, 2])
    for k in range(5, 9):
        write(tmp_path / f"{k}.json", calibration(str(k), value=float(k)))
    result = estimate(frame_of(tmp_path), FleetOptions())
    found = result.findings[0]
    assert (found.code, found.where, found.value) == ("sigma-missing", "bias_z", 4.0)
    assert "bias_z: no sigma. 4 such values are excluded" in found.text


def test_a_copy_of_a_result_counts_once(tmp_path) -> None:
    write(tmp_path / "a" / "1.json", calibration())
    write(tmp_path / "b" / "2.json", calibration())
    paths, _ = find_results([str(tmp_path)])
    frame, copies = to_frame(read_results(paths, Folders()))
    assert (len(frame), copies) == (1, 1)


def test_a_result_that_was_written_again_is_one_warning(tmp_path) -> None:
    write_fleet(str(tmp_path), FleetSize(4, 3, 2), seed=3)
    paths = sorted(find_results([str(tmp_path)])[0])
    doc = json.loads(Path(paths[3]).read_text())
    again = Path(paths[3]).with_name("again.json")
    again.write_text(json.dumps(doc))  # other bytes, the same values
    frame, copies = to_frame(read_results([*paths, str(again)], Folders()))
    assert copies == 0
    biases = FleetOptions(parameters=("bias_x", "bias_z"))
    found = [f for f in estimate(frame, biases).findings if f.code == "repeated-result"]
    assert len(found) == 1
    assert str(again) in found[0].text
    assert paths[3] in found[0].text
    frame, _ = to_frame(read_results(paths, Folders()))
    assert not [f for f in estimate(frame, biases).findings if "repeated" in f.code]


def test_each_invalid_file_is_one_line(tmp_path) -> None:
    write(tmp_path / "schema.json", calibration() | {"schema": 9})
    write(tmp_path / "shape.json", calibration() | {"parameters": {"bias_z": 3}})
    write(tmp_path / "nameless.json", calibration() | {"unit": {}})
    write(tmp_path / "other.json", [1, 2])
    (tmp_path / "broken.json").write_text("{")
    paths, _ = find_results([str(tmp_path)])
    chunk = read_results(paths, Folders())
    assert [fault.split(": ")[1] for fault in chunk.faults] == [
        "not a result file",
        "neither a serial nor an IMU name; set [unit] serial in the rig, or [fleet] path in the "
        "spec file",
        "schema 9 is not known; use the rotcli that wrote it",
        "parameters.bias_z",
    ]
    assert all("\n" not in fault for fault in chunk.faults)
    with pytest.raises(ResultError, match="no result files"):
        find_results([str(tmp_path / "none*")])


def test_folders_name_unit_and_day_by_the_spec(tmp_path) -> None:
    doc = calibration() | {"unit": {}}
    path = str(tmp_path / "U7" / "2026-03-01" / "x.json")
    file, values = rows_of(doc, path, "0" * 64, Folders("{unit}/{day}"))
    assert file[:2] == ("U7", "2026-03-01")
    assert values == [("bias_z", 1.0, 1.0, "deg/h")]
    dated = str(tmp_path / "run_20260301" / "x.json")
    named = calibration() | {"unit": {"serial": "A"}}
    assert rows_of(named, dated, "", Folders())[0][:2] == ("A", "2026-03-01")
    epoch = named | {"inputs": [{"start_s": 1.7e9}]}
    assert rows_of(epoch, "x.json", "", Folders())[0][1] == "2023-11-14"


def test_the_value_for_the_logs_span_enters_where_there_is_one(tmp_path) -> None:
    doc = calibration()
    doc["parameters"]["bias_z"]["own_span"] = {"value": 7.0, "sigma": 0.5}
    assert rows_of(doc, "x.json", "", Folders())[1] == [("bias_z", 7.0, 0.5, "deg/h")]


def test_allan_results_enter_by_coefficient() -> None:
    source, doc = documents.allan()
    doc["unit"] = {"serial": "A"}
    names = [row[0] for row in rows_of(doc, source.path, "", Folders())[1]]
    assert "gyro_x.random_walk" in names
    assert "accel_x.rate_random_walk" not in names  # null


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[limits]\nbias_q = { max = 1, unit = 'deg/h' }", "bias_q: no result has this parameter"),
        ("[limits]\nbias_z = { max = 1, unit = 'ppm' }", "unit ppm, but the results are in deg/h"),
        ("[limits]\nbias_z = { unit = 'deg/h' }", "neither min nor max"),
        ("[limits]\nbias_z = { min = 2, max = 1, unit = 'deg/h' }", "min 2 is not below max 1"),
        ("[limits]\nbias_z = { max = 1 }", "unit is missing"),
        ("[limits]\nbias_z = { max = 1, unit = 'deg/h', gard = 2 }", "similar: guard"),
        ("[limit]\n", "similar: limits"),
        ("[fleet]\npath = '{serial}'", "known fields: {unit}, {day}, {turn_on}"),
        ("limits = 3", r"\[limits\] must be a table"),
        ("[limits", "not a TOML file"),
    ],
)
def test_a_wrong_spec_is_one_line(frame, tmp_path, text, message) -> None:
    path = tmp_path / "spec.toml"
    path.write_text(text)
    with pytest.raises(RigError, match=message):
        estimate(frame, FleetOptions(), read_spec(str(path)))
