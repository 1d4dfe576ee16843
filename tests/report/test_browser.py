"""The page in a real browser: no complaints, nothing fetched, nothing that runs over."""

import importlib.util
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from rotcli.navigate.plot import ERROR_COLUMNS, navigation_errors
from rotcli.report.page import as_html
from rotcli.report.report import gather

_spec = importlib.util.spec_from_file_location("browser", Path(__file__).with_name("browser.py"))
browser = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(browser)

pytestmark = pytest.mark.skipif(browser.browser() is None, reason=browser.WHY_NOT)
WIDTHS = (390, 1400)  # px: a phone, a desk


@pytest.fixture(scope="module")
def page(documents, tmp_path_factory):
    docs = [*documents.small_campaign("NAV440"), *documents.small_campaign("MTi-G")]
    docs += [documents.allan("NAV440"), documents.allan("A-very-long-IMU-name-without-a-blank")]
    warning = "logs/a-folder/with_a_rather_long_path/imu-2024-11-23.parquet: 2 gaps bridged"
    docs.append(documents.navigation("NAV440", "full", 40.0, 3, 4, warnings=[warning]))
    solution = {name: np.arange(9.0) for name in ERROR_COLUMNS}
    extra = [("a run", partial(navigation_errors, solution, "a run"))]
    paths = documents.write(tmp_path_factory.mktemp("page"), *docs)
    return as_html(gather(paths, "A campaign"), extra)


@pytest.fixture(scope="module")
def seen(page, tmp_path_factory):
    found = browser.measure(tmp_path_factory.mktemp("seen"), page, *WIDTHS)
    assert [view["width"] for view in found] == list(WIDTHS)
    return found


def test_the_console_stays_silent(page, tmp_path):
    assert browser.console(tmp_path, page) == []
    spoilt = page.replace("</body>", "<script>console.error('heard')</script></body>")
    assert browser.console(tmp_path, spoilt)  # the policy of the page refuses it, aloud


def test_nothing_is_fetched(page, seen, tmp_path):
    assert [view["fetched"] for view in seen] == [[], []]
    spoilt = page.replace("</body>", '<img src="http://example.invalid/a.png"></body>')
    (view,) = browser.measure(tmp_path, spoilt, 1400)
    assert view["fetched"] == ["http://example.invalid/a.png"]


def test_tables_are_real_tables_with_a_head_over_every_column(seen):
    for view in seen:
        assert len(view["tables"]) > 10
        assert {table["display"] for table in view["tables"]} == {"table"}
        for table in view["tables"]:
            assert table["rows"] >= 1
            assert table["heads"] == table["cells"]


def test_text_and_figures_stay_inside_the_page(seen):
    for view in seen:
        assert view["scroll"] <= view["width"]
        assert view["overflowing"] == []
        assert view["figures"] == 7


def test_on_a_desk_no_table_of_results_has_to_be_scrolled(seen):
    wide = seen[WIDTHS.index(1400)]
    assert [t["name"] for t in wide["tables"] if t["scrolls"]] == []


def test_text_that_runs_over_would_be_seen(page, tmp_path):
    spoilt = page.replace("<main>", '<main><p style="white-space:nowrap">' + "long " * 400 + "</p>")
    (view,) = browser.measure(tmp_path, spoilt, 390)
    assert view["scroll"] > view["width"]
    assert view["overflowing"]
