import re
from functools import partial
from html.parser import HTMLParser

import numpy as np
import pytest

from rotcli.navigate.plot import ERROR_COLUMNS, navigation_errors
from rotcli.report.page import MAX_FIGURES, _chosen, as_html
from rotcli.report.render import as_markdown
from rotcli.report.report import gather

VOID = {"meta", "br", "link", "img", "hr", "input"}


class Checker(HTMLParser):
    """Collects elements, ids and text, and fails on a tag that is not closed in turn."""

    def __init__(self):
        super().__init__()
        self.open, self.ids, self.tags, self.references = [], [], [], []
        self.text = []

    def handle_startendtag(self, tag, attributes):
        self.note(tag, attributes)

    def handle_starttag(self, tag, attributes):
        self.note(tag, attributes)
        if tag not in VOID:
            self.open.append(tag)

    def note(self, tag, attributes):
        self.tags.append(tag)
        for name, value in attributes:
            if name == "id":
                self.ids.append(value)
            if name in ("href", "src", "xlink:href"):
                self.references.append(value)
            self.references += re.findall(r"url\(([^)]*)\)", value or "")

    def handle_endtag(self, tag):
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)


def check(html):
    checker = Checker()
    checker.feed(html)
    checker.close()
    assert checker.open == []
    return checker


def page(documents, tmp_path, docs, extra=(), title="rotcli report"):
    return as_html(gather(documents.write(tmp_path, *docs), title), extra)


@pytest.fixture(scope="module")
def full_page(documents, tmp_path_factory):
    docs = [*documents.small_campaign(), documents.allan("NAV440")]
    docs.append(
        documents.navigation("NAV440", "full", 40.0, 3, 4, warnings=["bridged a gap of 2 samples"])
    )
    solution = {name: np.arange(9.0) for name in ERROR_COLUMNS}
    extra = [("a run", partial(navigation_errors, solution, "a run"))]
    return page(documents, tmp_path_factory.mktemp("page"), docs, extra)


def test_the_page_is_well_formed_with_one_heading_and_real_tables(full_page):
    checker = check(full_page)
    assert checker.tags.count("h1") == 1
    assert checker.tags.count("svg") == 4  # RMS, calibration, Allan, the run
    assert checker.tags.count("caption") > 8
    assert "script" not in checker.tags


def test_the_page_fetches_nothing(full_page):
    assert "http://" not in full_page
    assert "https://" not in full_page
    assert "@import" not in full_page
    references = check(full_page).references
    assert references
    assert all(reference.startswith("#") for reference in references)


def test_ids_are_unique_and_references_inside_figures_meet_their_own(full_page):
    checker = check(full_page)
    assert len(set(checker.ids)) == len(checker.ids)
    assert {reference[1:] for reference in checker.references} <= set(checker.ids)


def test_the_page_reports_the_summary_the_warning_and_the_provenance(full_page):
    text = " ".join(check(full_page).text)
    assert "Turning with the full calibration (full) is best" in text
    assert "bridged a gap of 2 samples" in text
    assert "1 warning" in text
    assert "ab" * 32 in text
    assert "[site] latitude" in text
    assert re.search(r"reported by rotcli \d", text)


def test_a_page_without_warnings_has_no_box_for_them(documents, tmp_path):
    html = page(documents, tmp_path, [documents.calibration("B", 10.0)])
    assert 'class="warnings"' not in html
    check(html)


def test_names_are_escaped_everywhere(documents, tmp_path):
    evil = '<script>alert("x")</script>--><b>&'
    docs = documents.small_campaign(evil)
    docs += [documents.allan(evil)]
    docs += [documents.navigation(evil, "full", 40.0, 3, 4, warnings=["<img src=x onerror=y>"])]
    docs[0]["inputs"][0] = {**docs[0]["inputs"][0], "path": "<iframe>"}
    docs[0]["rig"]["site"]["<u>"] = "<i>"
    html = page(documents, tmp_path, docs, title="<title>{{ 7 * 7 }}")
    checker = check(html)
    assert not {"script", "img", "iframe", "b", "u", "i"} & set(checker.tags)
    assert checker.tags.count("title") == 1
    assert "{{ 7 * 7 }}" in html
    assert evil in "".join(checker.text)


def test_the_same_results_give_the_same_bytes(documents, tmp_path, full_page):
    docs = documents.small_campaign()
    assert page(documents, tmp_path, docs) == page(documents, tmp_path, docs)


def test_the_report_of_a_complete_campaign_is_small(documents, tmp_path):

    docs = []
    for imu in ("MTi-G", "NAV440"):
        docs += [documents.navigation(imu, "conventional", 0.0, 9.0 + k, 5.0) for k in range(10)]
        for rate in range(10, 110, 10):
            docs += [documents.navigation(imu, "partial", rate, 4.0, 0.1 * rate)]
            docs += [documents.navigation(imu, "full", rate, 3.0, 0.01 * rate)]
            docs += [documents.calibration(imu, float(rate), shift=0.1 * rate)]
        noise = documents.allan(imu)
        for stored in noise["axes"].values():  # 80 cluster times, as two hours have
            tau = np.geomspace(0.01, 2000.0, 80)
            stored["tau_s"] = tau.tolist()
            for k, key in enumerate(("lower", "deviation", "upper")):
                stored[key] = ((0.9 + 0.1 * k) * (tau**-0.5 + 0.01 * tau**0.5)).tolist()
        docs.append(noise)
    paths = documents.write(tmp_path, *docs)
    solution = {name: np.sin(np.arange(30_000.0)) for name in ERROR_COLUMNS}
    html = as_html(gather(paths, "t"), [("a run", partial(navigation_errors, solution, "a run"))])
    assert len(html.encode()) < 3_000_000
    assert check(html).tags.count("svg") == 7


def test_twelve_figures_are_shown_in_turn_of_the_sections_and_the_rest_folded():
    sections = [[(f"{name}{k}", None) for k in range(count)] for name, count in
                (("a", 20), ("b", 3), ("c", 0), ("d", 2))]  # fmt: skip
    chosen = _chosen(sections, 6)
    shown = [[title for title, _ in part.shown] for part in chosen]
    assert shown == [[f"a{k}" for k in range(7)], ["b0", "b1", "b2"], [], ["d0", "d1"]]
    assert sum(map(len, shown)) == MAX_FIGURES
    assert [title for title, _ in chosen[0].folded] == [f"a{k}" for k in range(7, 13)]
    assert [part.left for part in chosen] == [7, 0, 0, 0]


def test_folded_figures_and_provenance_are_behind_a_summary(documents, tmp_path, monkeypatch):
    monkeypatch.setattr("rotcli.report.page.MAX_FIGURES", 3)  # drawn faster than 12
    html = page(documents, tmp_path, [documents.allan(f"IMU {k}") for k in range(5)])
    assert "2 more figures" in html
    before, _, behind = html.partition("2 more figures")
    assert before.count('<svg class="plot"') == 3
    assert behind.count('<svg class="plot"') == 2
    assert "<details><summary>Result files, logs with their hashes, rigs" in html
    check(html)


def test_serial_date_operator_place_and_customer_are_on_the_page(documents, tmp_path):
    doc = documents.calibration("B", 10.0)
    doc["unit"] = {"serial": "00017", "date": "2026-11-28", "operator": "Ada", "place": "Lab 3"}
    doc["unit"]["customer"] = "A & B"
    text = " ".join(check(page(documents, tmp_path, [doc])).text)
    for word in ("Devices under test", "00017", "2026-11-28", "Ada", "Lab 3", "A & B"):
        assert word in text
    bare = page(documents, tmp_path, [documents.calibration("B", 20.0)])
    assert "Devices under test" not in bare


def test_a_report_compares_with_the_papers_on_request_only(documents, tmp_path):
    paths = documents.write(tmp_path, *documents.small_campaign("NAV440"))
    plain = as_markdown(gather(paths, "t"))
    compared = as_markdown(gather(paths, "t", published=True))
    for word in ("R16", "ublished", "paper"):
        assert word not in plain
    assert "(R16 tables 4, 5)" in compared
    assert "| published |" in compared
