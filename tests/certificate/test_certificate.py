"""Contents, verdicts and pages of a certificate."""

import json
import re
import shutil

import pytest

from rotcli.certificate.collect import certificate, limit_text
from rotcli.certificate.curves import Input
from rotcli.certificate.numbers import digits_of
from rotcli.certificate.pdf import find_browser, reproducible, to_pdf
from rotcli.certificate.render import to_html, to_markdown
from rotcli.errors import ResultError, RigError
from rotcli.files.results.find import find_results
from rotcli.files.spec import Spec
from rotcli.fleet.document import to_document
from rotcli.fleet.estimate import FleetOptions, estimate
from rotcli.fleet.records import Folders
from rotcli.fleet.scan import read_results, to_frame
from rotcli.fleet.simulate import FleetSize, write_fleet
from rotcli.models.conformity import Limits
from tests.certificate import documents as docs
from tests.report import browser

TITLE = "Calibration certificate"
LIMITS = {
    "bias_x": Limits(-120.0, 120.0, "deg/h"),
    "bias_y": Limits(-80.0, 80.0, "deg/h"),
    "bias_z": Limits(-120.0, 120.0, "deg/h"),
    "gyro_x.random_walk": Limits(None, 0.5, "deg/sqrt(h)"),
    "accel_x.rate_random_walk": Limits(None, 5.0, "ug/sqrt(s)"),
}


def inputs(*made) -> list[Input]:
    return [Input(f"r{k}.json", f"{k}" * 64, doc) for k, doc in enumerate(made)]


def complete(spec: Spec | None = None, fleet=None):
    results = inputs(
        docs.triad("2026-03-01", 5.0), docs.triad(), docs.allan(), docs.scale(), docs.thermal()
    )
    return certificate(results, spec, fleet)


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    path = tmp_path_factory.mktemp("fleet")
    write_fleet(str(path), FleetSize(6, 6, 2), seed=2)
    frame, _ = to_frame(read_results(find_results([str(path)])[0], Folders()))
    result = estimate(frame, FleetOptions(parameters=("bias_*", "Kgz")))
    return json.loads(json.dumps(to_document(result, [])))


def test_the_last_value_counts_and_repeated_ones_have_a_mean() -> None:
    made = complete()
    rows = {row.name: row for row in made.parameters}
    assert (rows["bias_x"].value, rows["bias_x"].mean) == (120.0, 122.5)
    assert rows["bias_x"].turn_ons == 2
    assert made.dates == ("2026-03-01", "2026-03-02")
    assert made.issued == "2026-03-02"
    assert made.verdict is None
    assert rows["Ka2_z"].value is None
    assert "gravity" not in rows  # of the site, not of the device
    assert "middle_zero" not in rows


def test_verdicts_follow_the_guard_band_and_the_worst_one_decides() -> None:
    made = complete(Spec("spec.toml", LIMITS))
    words = {row.name: row.verdict for row in made.parameters if row.verdict}
    # 120 at the limit 120 +- 4: undecided; -90 beyond -80 by 2.5 sigma: fail.
    assert words == {"bias_x": "undecided", "bias_y": "fail", "bias_z": "pass"}
    noise = {f"{row.axis} {row.symbol}": row.verdict for row in made.noise if row.verdict}
    assert noise == {"gyro_x N": "pass", "accel_x K": "pass"}
    assert made.verdict == "fail"
    only = Spec("spec.toml", {"bias_z": LIMITS["bias_z"]})
    assert complete(only).verdict == "pass"


def test_a_limit_without_a_value_is_named_and_prevents_a_pass() -> None:
    spec = Spec("spec.toml", {"bias_z": LIMITS["bias_z"], "Kgq": Limits(0.0, 1.0, "ppm")})
    made = complete(spec)
    assert made.verdict == "undecided"
    assert "Kgq (limits of the specification)" in made.not_tested


def test_what_was_not_tested_is_named() -> None:
    assert complete().not_tested == ("second-order accelerometer terms Ka2_z",)
    alone = certificate(inputs(docs.allan()))
    assert "gyro biases" in alone.not_tested
    assert "temperature" in alone.not_tested
    assert "gyro noise" not in alone.not_tested
    column = docs.triad()
    column["parameters"] = {k: v for k, v in column["parameters"].items() if k[:4] != "gsen"}
    del column["parameters"]["bias_y"]
    missing = certificate(inputs(column)).not_tested
    assert "gyro biases bias_y" in missing
    assert "g-sensitivity" in missing


def test_scale_and_temperature_tests_have_their_figures() -> None:
    rows = {(row.test, row.name): row.cells for row in complete().tests}
    assert rows["scale", "scale factor"] == ("1200 ± 30 ppm",) * 3
    assert rows["scale", "nonlinearity"] == (
        "below 65 ppm FS", "below 65 ppm FS", "41 ± 15 ppm FS",
    )  # fmt: skip
    assert rows["thermal", "gyro_x bias"] == ("60, 10, -0.09375, 0.00125 deg/h/degC^n",)
    assert rows["thermal", "range"] == ("-20 to 60 degC, reference 20",)
    assert rows["thermal", "gyro residual, left-out soaks"] == (
        "x 29.9 deg/h, y 29.9 deg/h, z 29.9 deg/h",
    )


def test_three_dated_results_make_a_chart_of_the_biases_over_time() -> None:
    dates = ("2026-03-01", "2026-03-15", "2026-04-01")
    made = certificate(inputs(*(docs.triad(date, 2.0 * k) for k, date in enumerate(dates))))
    label, days, values, sigmas = made.curves.history[0]
    assert (label, tuple(days), values, sigmas) == (
        "bias_x", dates, [120.0, 122.0, 124.0], [4.0, 4.0, 4.0],
    )  # fmt: skip
    assert 'aria-label="Gyro biases over the results"' in to_html(made, TITLE)
    assert complete().curves.history[0][0] == "bias_z"  # two triads and the scale test


def test_a_fleet_adds_repeatability_and_position(fleet) -> None:
    rows = {row.name: row for row in complete(fleet=fleet).parameters}
    expected = fleet["parameters"]["bias_z"]["repeatability"]
    assert rows["bias_z"].fleet_turn_on == expected["turn_on"]["value"]
    assert rows["bias_z"].fleet_day_to_day == expected["day_to_day"]["value"]
    assert 0.0 <= rows["bias_z"].percentile <= 100.0
    other = docs.triad()
    other["unit"]["serial"] = "SN9999"
    with pytest.raises(ResultError, match="the fleet contains no results of SN9999"):
        certificate(inputs(other), fleet=fleet)


@pytest.mark.parametrize(
    ("value", "sigma", "text"),
    [
        (62.8571, 14.23, "63"),
        (62.8571, 0.1423, "62.86"),
        (-3.14159, 0.01, "-3.142"),
        (5.0, None, "5"),
    ],
)
def test_values_have_the_digits_of_their_sigma(value, sigma, text) -> None:
    assert digits_of(value, sigma) == text


def test_an_upper_limit_has_both_unit_systems_and_the_range_its_digits() -> None:
    doc, warm = docs.allan(), docs.thermal()
    walk = doc["axes"]["gyro_x"]["coefficients"]["rate_random_walk"]
    walk |= {"value": None, "sigma": None, "upper": 1.6, "unit": "deg/h/sqrt(s)"}
    walk["si"] = {"value": None, "sigma": None, "unit": "rad/s/sqrt(s)"}
    warm["temperature"]["low"] = 2.7e-10
    text = to_markdown(certificate(inputs(doc, warm), None, None), TITLE)
    # 1.6 deg/h/sqrt(s) times pi/180/3600.
    assert "< 1.6 | deg/h/sqrt(s) | < 7.8e-06 rad/s/sqrt(s)" in text
    assert "0 to 60 degC" in text


def test_limits_read_as_words() -> None:
    assert limit_text(Limits(-1.0, 2.5, "x")) == "-1 to 2.5"
    assert limit_text(Limits(None, 2.5, "x")) == "below 2.5"
    assert limit_text(Limits(3.0, None, "x")) == "above 3"


def test_wrong_inputs_are_one_line() -> None:
    other = docs.triad()
    other["unit"]["serial"] = "SN0002"
    with pytest.raises(ResultError, match=r"r1\.json: serial SN0002, but another input has SN0001"):
        certificate(inputs(docs.triad(), other))
    with pytest.raises(ResultError, match="kind budget has no place in a certificate"):
        certificate(inputs({"kind": "budget"}))
    with pytest.raises(ResultError, match="not valid results"):
        certificate(inputs({"kind": "calibration"}))
    with pytest.raises(ResultError, match="no results"):
        certificate([])
    wrong = Spec("spec.toml", {"bias_z": Limits(0.0, 1.0, "ppm")})
    with pytest.raises((ResultError, RigError), match="unit ppm, but the result is in deg/h"):
        complete(wrong)


def test_markdown_contains_every_parameter_hash_and_equation() -> None:
    text = to_markdown(complete(Spec("spec.toml", LIMITS)), TITLE)
    for expected in (
        "SN0001",
        "Example Ltd",
        "| bias_x | 120.0 |",
        "undecided",
        "0" * 64,
        "gsens_zz",
    ):
        assert expected in text
    assert "f = (I + M)^-1 (accel - b)" in text
    assert "**Result: fail**" in text
    assert text == to_markdown(complete(Spec("spec.toml", LIMITS)), TITLE)


def test_the_page_escapes_and_fetches_nothing() -> None:
    doc, noise = docs.triad(), docs.allan()
    doc["unit"]["operator"] = noise["unit"]["operator"] = "<b>&"
    page = to_html(certificate(inputs(doc, noise)), "A <title>")
    assert "&lt;b&gt;&amp;" in page
    assert "A &lt;title&gt;" in page
    assert "<script" not in page
    assert "0.4000 deg/sqrt(h)" in page
    assert page == to_html(certificate(inputs(doc, noise)), "A <title>")


needs_browser = pytest.mark.skipif(find_browser() is None, reason=browser.WHY_NOT)


@needs_browser
def test_the_complete_certificate_prints_on_one_page(fleet) -> None:
    page = to_html(complete(Spec("spec.toml", LIMITS), fleet), TITLE)
    pdf = to_pdf(page, "x.pdf")
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) == 1
    width, height = (float(v) for v in re.search(rb"/MediaBox \[0 0 (\S+) (\S+)\]", pdf).groups())
    assert (width, height) == (pytest.approx(595, abs=2), pytest.approx(842, abs=2))  # A4, points
    assert to_pdf(page, "x.pdf") == pdf


@needs_browser
def test_text_and_figures_stay_inside_the_page_on_a_phone_and_a_desk(fleet, tmp_path) -> None:
    page = to_html(complete(Spec("spec.toml", LIMITS), fleet), TITLE)
    phone, desk = browser.measure(tmp_path, page, 390, 1400)
    for view in (phone, desk):
        assert view["overflowing"] == []
        assert view["scroll"] <= view["width"] + 1
        assert view["figures"] == 3
        assert view["fetched"] == []
    assert not any(table["scrolls"] for table in desk["tables"])


def test_the_time_of_printing_and_the_count_of_nodes_do_not_change_the_bytes() -> None:
    one = b"/CreationDate (D:20260302101112+00'00') /ID (node00000047) /P (node00000049)"
    two = b"/CreationDate (D:20260302101113+00'00') /ID (node00000046) /P (node00000048)"
    assert reproducible(one) == reproducible(two)
    assert len(reproducible(one)) == len(one)
    assert b"(node00000001)" in reproducible(one)
    other = b"/CreationDate (D:20260302101113+00'00') /ID (node00000048) /P (node00000046)"
    assert reproducible(one) != reproducible(other)


def test_without_a_browser_the_error_names_the_alternative(monkeypatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(ResultError, match=r"x\.pdf: no Chromium browser .* write \.html"):
        to_pdf("<p>", "x.pdf")
