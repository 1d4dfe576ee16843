import random

import pytest

from rotcli.allan.campaign import allan_tables
from rotcli.calibrate.campaign import calibration_tables
from rotcli.errors import ResultError
from rotcli.files.results.groups import Source
from rotcli.files.tables import Estimate
from rotcli.navigate.campaign.tables import navigation_tables
from rotcli.report.render import as_text
from rotcli.report.report import gather
from rotcli.report.summary import calibration_sentences, verdicts


def of(tables, title):
    found = [table for table in tables if table.title.startswith(title)]
    assert len(found) == 1, [table.title for table in tables]
    return found[0]


@pytest.fixture
def navigated(documents):
    docs = [doc for doc in documents.small_campaign() if doc["kind"] == "navigation"]
    return documents.sources(*docs)


def test_conventional_rms_is_the_mean_of_the_runs_next_to_the_published_one(documents, navigated):
    table = of(navigation_tables(navigated, published=True), "Conventional")
    by_name = {row["error"]: row for row in documents.rows(table)}
    latitude = by_name["latitude, m"]
    assert (latitude["runs"], latitude["RMS"]) == (2, 600.0)
    assert (latitude["min"], latitude["max"]) == (300.0, 900.0)
    assert latitude["published"] == 829.1
    assert latitude["ratio"] == pytest.approx(600.0 / 829.1)
    assert by_name["horizontal position, m"]["RMS"] == 1000.0
    assert by_name["height, m"]["RMS"] == 7.0
    assert by_name["azimuth, deg"]["published"] == 0.73
    assert len(by_name) == 11


def test_each_rate_and_mode_has_its_mean_and_gain(documents, navigated):
    table = of(navigation_tables(navigated, published=True), "RMS errors for each")
    rows = documents.rows(table)
    assert [(row["mode"], row["rate, deg/s"], row["runs"]) for row in rows] == [
        ("conventional", 0.0, 2),
        *(("partial", rate, 1) for rate in (10.0, 20.0, 30.0)),
        *(("full", rate, 1) for rate in (10.0, 20.0, 30.0)),
    ]
    assert [row["horizontal position, m"] for row in rows] == [1000.0, *[500.0] * 3, *[250.0] * 3]
    assert [row["gain"] for row in rows] == [None, 2.0, 2.0, 2.0, 4.0, 4.0, 4.0]


def test_the_nine_errors_have_a_row_for_each_mode_and_rate(documents, navigated):
    tables = navigation_tables(navigated)
    position = documents.rows(of(tables, "RMS errors of position"))
    assert [(row["mode"], row["rate, deg/s"], row["runs"]) for row in position][:2] == [
        ("conventional", 0.0, 2),
        ("partial", 10.0, 1),
    ]
    assert [row["latitude, m"] for row in position] == [600.0, *[300.0] * 3, *[150.0] * 3]
    assert [row["longitude, m"] for row in position] == [800.0, *[400.0] * 3, *[200.0] * 3]
    assert {"v north, m/s", "v east, m/s", "v up, m/s"} < set(position[0])
    assert [row["azimuth, deg"] for row in position][1:4] == [1.0, 2.0, 3.0]


def test_azimuth_is_compared_with_the_mean_of_pitch_and_roll_over_the_rates(documents):
    docs = []
    for rate, azimuth in ((10.0, 1.0), (20.0, 3.0)):
        doc = documents.navigation("B", "full", rate, 0.0, 1.0, azimuth)
        doc["rms"] |= {"pitch_deg": 0.1, "roll_deg": 0.3}
        doc["expected"] = {
            name: {"rms": rms} for name, rms in (("pitch_deg", 0.2), ("roll_deg", 0.2),
                                                 ("azimuth_deg", rate / 10.0))
        }  # fmt: skip
        docs.append(doc)
    (row,) = documents.rows(of(navigation_tables(documents.sources(*docs)), "Attitude RMS"))
    assert (row["pitch, deg"], row["roll, deg"], row["azimuth, deg"]) == pytest.approx(
        (0.1, 0.3, 2)
    )
    assert row["azimuth / level"] == pytest.approx(10.0)
    assert row["expected"] == pytest.approx(7.5)


def test_campaign_means_are_next_to_the_published_ones_with_their_ratio(documents, navigated):
    rows = documents.rows(of(navigation_tables(navigated, published=True), "Horizontal RMS errors"))
    full = rows[2]
    assert (full["mode"], full["rates"], full["runs"]) == ("full", 3, 3)
    assert (full["position, m"], full["published, m"]) == (250.0, 213.8)
    assert full["ratio"] == pytest.approx(250.0 / 213.8)
    assert full["ratio of velocities"] == pytest.approx(2.5 / 2.2)
    assert [row["gain"] for row in rows] == [None, 2.0, 4.0]


def test_a_rate_run_twice_weighs_no_more_than_the_others(documents):
    docs = [
        documents.navigation("B", "full", rate, 0.0, east)
        for rate, east in ((10.0, 100.0), (10.004, 300.0), (20.0, 800.0))
    ]
    tables = navigation_tables(documents.sources(*docs))
    by_rate = documents.rows(of(tables, "RMS errors for each"))
    assert [row["runs"] for row in by_rate] == [2, 1]
    assert [row["horizontal position, m"] for row in by_rate] == [200.0, 800.0]
    (means,) = documents.rows(of(tables, "Horizontal RMS errors"))
    assert means["position, m"] == 500.0
    assert (means["rates"], means["runs"]) == (2, 3)


def test_azimuth_growth_is_the_slope_against_the_rate(documents, navigated):
    rows = documents.rows(of(navigation_tables(navigated), "Azimuth RMS"))
    assert [(row["mode"], row["rates"]) for row in rows] == [("partial", 3), ("full", 3)]
    assert rows[0]["slope, deg per deg/s"] == pytest.approx(0.1)
    assert rows[0]["correlation"] == pytest.approx(1.0)
    assert rows[1]["slope, deg per deg/s"] == 0.0
    assert rows[1]["correlation"] is None


def test_an_imu_without_published_figures_has_no_column_for_them(documents):
    docs = documents.small_campaign("my IMU")
    navigated = [doc for doc in docs if doc["kind"] == "navigation"]
    calibrated = [doc for doc in docs if doc["kind"] == "calibration"]
    tables = navigation_tables(documents.sources(*navigated), published=True)
    tables += calibration_tables(documents.sources(*calibrated), published=True)
    for table in tables:
        assert not [head for head in table.headings if "published" in head or "ratio" in head]
        assert "in bound" not in table.headings
        assert "ublished" not in table.note


def test_windows_of_another_length_are_not_set_against_the_published_ones(documents):
    docs = [documents.navigation("NAV440", "full", r, 3, 4, duration=60.0) for r in (10.0, 20.0)]
    table = of(navigation_tables(documents.sources(*docs), published=True), "Horizontal RMS errors")
    assert "published, m" in table.headings
    assert "ratio" not in table.headings
    assert "Published values are for 300 s" in table.note
    mixed = [*docs, documents.navigation("NAV440", "partial", 10.0, 3, 4)]
    tables = navigation_tables(documents.sources(*mixed), published=True)
    assert "60 to 300 s are mixed" in of(tables, "RMS errors for each").note
    (verdict,) = verdicts(documents.sources(*mixed))
    assert verdict.best is None
    assert "not compared" in verdict.sentence


def test_another_axis_is_another_unit_with_the_same_conventional_level(documents):
    docs = [
        documents.navigation("NAV440", "conventional", 0.0, 300.0, 400.0),
        documents.navigation("NAV440", "full", 10.0, 30.0, 40.0, axis="x"),
        documents.navigation("NAV440", "full", 10.0, 60.0, 80.0),
    ]
    rows = documents.rows(
        of(navigation_tables(documents.sources(*docs), published=True), "Horizontal")
    )
    assert [(row["IMU"], row["gain"]) for row in rows] == [
        ("NAV440 about x", 10.0),
        ("NAV440", None),
        ("NAV440", 5.0),
    ]
    assert rows[0]["published, m"] is None


def test_conventional_navigation_of_a_turning_table_is_no_conventional_run(documents):
    turning = documents.navigation("NAV440", "conventional", 30.0, 3000.0, 4000.0)
    docs = [turning, documents.navigation("NAV440", "full", 30.0, 30.0, 40.0)]
    tables = navigation_tables(documents.sources(*docs), published=True)
    assert not [table for table in tables if table.title.startswith("Conventional")]
    rows = documents.rows(of(tables, "RMS errors for each"))
    assert [(row["mode"], row["rate, deg/s"]) for row in rows] == [
        ("conventional, turning", 30.0),
        ("full", 30.0),
    ]
    assert "gain" not in rows[0]
    assert documents.rows(of(tables, "Horizontal"))[0]["published, m"] is None
    (verdict,) = verdicts(documents.sources(*docs))
    assert [line.mode for line in verdict.modes] == ["conventional, turning", "full"]
    assert [line.gain for line in verdict.modes] == [None, None]
    (alone,) = verdicts(documents.sources(turning))
    assert "turning without a calibration (conventional)" in alone.sentence


def test_noise_errors_are_next_to_table_6(documents):
    docs = [documents.calibration("MTi-G", rate) for rate in (10.0, 45.0)]
    rows = documents.rows(
        of(calibration_tables(documents.sources(*docs), published=True), "Calibration errors")
    )
    assert rows[0]["bias predicted, deg/h"] == 3.1
    assert rows[0]["bias estimated, deg/h"] == 2.0
    assert rows[0]["bias published, deg/h"] == 23.2
    assert rows[0]["scale predicted, ppm"] == 86.1
    assert rows[0]["scale estimated, ppm"] == 30.0
    assert [row["scale published, ppm"] for row in rows] == [645.5, None]


@pytest.mark.parametrize(
    ("mean", "inside"),
    [
        ((0.0, 0.0, 10.024), "1 of 1"),
        ((0.0, 0.0, 10.026), "0 of 1"),
        ((0.0, 0.0, 9.974), "0 of 1"),
        ((0.0109, -0.0109, 10.0), "1 of 1"),
        ((0.0, -0.0111, 10.0), "0 of 1"),
    ],
)
def test_the_mean_gyro_output_is_stored_against_the_bound_of_table_7(documents, mean, inside):
    docs = documents.sources(documents.calibration("NAV440", 10.0, mean=mean))
    (row,) = documents.rows(of(calibration_tables(docs, published=True), "Mean gyro output"))
    assert row["in bound"] == inside
    assert row["axis rate error, deg/s"] == pytest.approx(mean[2] - 10.0)


def test_parameters_of_different_axes_have_tables_of_their_own(documents):
    docs = [documents.calibration("B", 10.0), documents.calibration("B", 10.0, axis="x")]
    tables = calibration_tables(documents.sources(*docs))
    found = [table for table in tables if table.title == "Calibrated parameters"]
    assert ["Kgx, ppm" in table.headings for table in found] == [True, False]
    assert documents.rows(found[0])[0]["IMU"] == "B about x"


def test_unknown_sigmas_and_predictions_are_dashes_or_no_column(documents):
    doc = documents.calibration("B", 10.0)
    for quantity in (*doc["parameters"].values(), doc["predicted_sigma"]["bias"]):
        quantity["sigma"] = None
    doc["predicted_sigma"] = {"bias": {"value": None}, "scale": {"value": None}}
    tables = calibration_tables(documents.sources(doc))
    assert tables[0].title == "Calibrated parameters"
    assert not [table for table in tables if "noise" in table.title]
    assert calibration_sentences(documents.sources(doc)) == []


def test_allan_coefficients_are_one_row_per_axis_with_limits_instead_of_dashes(documents):
    doc = documents.allan("B")
    doc["axes"]["gyro_y"]["coefficients"]["quantization"]["upper"] = 0.654
    gyros, accels = allan_tables(documents.sources(doc))
    assert gyros.title == "Noise of the gyros from the Allan deviation"
    rows = documents.rows(gyros)
    assert [row["axis"] for row in rows] == ["gyro_x", "gyro_y", "gyro_z"]
    assert rows[0]["random walk, deg/sqrt(h)"] == Estimate(0.25, 0.01, None)
    assert rows[0]["lowest deviation, deg/h"] == 1.0
    assert rows[0]["at cluster time, s"] == 100.0
    shown = [dict(zip(gyros.headings, row, strict=True)) for row in gyros.shown]
    assert shown[0]["random walk, deg/sqrt(h)"] == "0.250 ± 0.010"
    quantization = next(head for head in gyros.headings if head.startswith("quantization"))
    assert [row[quantization] for row in shown] == ["-", "< 0.65", "-"]
    assert [row["axis"] for row in documents.rows(accels)] == ["accel_x", "accel_y", "accel_z"]


def test_the_summary_says_which_mode_is_best_and_by_how_much(documents, navigated):
    (verdict,) = verdicts(navigated)
    assert verdict.best == "full"
    assert verdict.sentence == (
        "NAV440: turning with the full calibration (full) is best: horizontal position error "
        "250 m RMS over 300 s, 4 times smaller than conventional (1000 m); smaller at all 3 rates "
        "from 10 to 30 deg/s."
    )


def test_the_summary_does_not_praise_what_is_no_better(documents):
    docs = [
        documents.navigation("B", "conventional", 0.0, 3.0, 4.0),
        documents.navigation("B", "partial", 10.0, 6.0, 8.0),
    ]
    (verdict,) = verdicts(documents.sources(*docs))
    assert verdict.best == "conventional"
    assert "turning gives 10 m or more" in verdict.sentence
    (alone,) = verdicts(documents.sources(docs[1]))
    assert alone.best is None
    assert "best" not in alone.sentence
    assert "10 m RMS" in alone.sentence
    docs.append(documents.navigation("B", "full", 10.0, 1.0, 0.0))
    docs.append(documents.navigation("B", "partial", 10.0, 1.05, 0.0, axis="x"))
    docs.append(documents.navigation("B", "full", 10.0, 1.0, 0.0, axis="x"))
    about_x, about_z = verdicts(documents.sources(*docs))
    assert about_x.sentence.endswith("at 10 deg/s; partial is close behind (1.05 m).")
    assert "close" not in about_z.sentence


def test_the_order_of_the_files_is_of_no_consequence(documents, tmp_path):
    docs = [*documents.small_campaign("NAV440"), *documents.small_campaign("MTi-G")]
    paths = documents.write(tmp_path, *docs)
    text = as_text(gather(paths, "t"))
    random.Random(1).shuffle(paths)
    assert as_text(gather(paths, "t")) == text
    assert text.index("MTi-G") < text.index("NAV440")


def test_one_navigation_file_shows_all_its_figures(documents):
    tables = navigation_tables(documents.sources(documents.navigation("B", "full", 10.0, 3.0, 4.0)))
    (table,) = tables
    assert table.title == "Navigation errors, full, 300 s, mean table rate 10 deg/s"
    assert table.headings == ["error", "RMS", "final", "max"]
    assert [row[0] for row in table.rows][6:9] == ["pitch, deg", "roll, deg", "azimuth, deg"]


def test_the_same_result_twice_counts_once_and_is_remarked(documents, tmp_path):
    doc = documents.navigation("B", "full", 10.0, 3.0, 4.0)
    other = documents.navigation("B", "full", 20.0, 3.0, 4.0)
    report = gather(documents.write(tmp_path, doc, other, doc), "t")
    assert len(report.sources) == 2
    assert report.remarks == (
        f"{tmp_path}/2.json: the same result as {tmp_path}/0.json; counted once",
    )


def test_the_truth_of_a_simulation_is_left_out_with_a_remark(documents, tmp_path):
    truth = documents.document("simulation", "B")
    report = gather(documents.write(tmp_path, truth, documents.allan("B")), "t")
    assert len(report.sources) == 1
    assert "not a result; skipped" in report.remarks[0]
    with pytest.raises(ResultError, match=r"0\.json: no results to report on"):
        gather([str(tmp_path / "0.json")], "t")


def test_a_kind_without_a_table_is_refused_by_name(documents, tmp_path):
    paths = documents.write(tmp_path, documents.document("weather", "B"))
    with pytest.raises(ResultError, match=r"0\.json: .*'weather'; known are navigation, calibr"):
        gather(paths, "t")


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda doc: doc["rms"].pop("azimuth_deg"), r"f\.json: rms\.azimuth_deg: None is not a"),
        (lambda doc: doc.update(mode="best"), r"f\.json: mode: 'best' is none of conventional"),
        (lambda doc: doc.pop("rate"), r"f\.json: rate\.value: None"),
        (lambda doc: doc["rig"]["table"].update(axis={}), None),
        (lambda doc: doc["rig"]["table"].update(axis=[1, "y"]), r"f\.json: axis: \[1, 'y'\]"),
    ],
)
def test_a_damaged_navigation_document_is_named(documents, spoil, said):
    doc = documents.navigation("B", "full", 10.0, 3.0, 4.0)
    spoil(doc)
    if said is None:
        assert navigation_tables([Source("f.json", doc)])
        return
    with pytest.raises(ResultError, match=said):
        navigation_tables([Source("f.json", doc)])


def test_an_imu_without_a_name_is_called_so(documents):
    docs = [documents.navigation(None, "full", r, 3.0, 4.0) for r in (10.0, 20.0)]
    assert documents.rows(navigation_tables(documents.sources(*docs))[0])[0]["IMU"] == "unnamed IMU"
