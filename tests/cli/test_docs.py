"""The documentation is true: its commands run, its keys exist, generated pages are up to date."""

import json
import re
import shlex
import textwrap
from pathlib import Path

import pytest

from rotcli.cli.look.help import TOPICS
from rotcli.rig.keys import KEYS
from tests.cli.commands import leaf_commands
from tests.reference_pages import pages

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("tutorial/*.md")), *sorted(DOCS.glob("how-to/*.md"))]
# Words of a command that needs what a test has not: recorded logs, a cluster, hours.
_NEEDS_MORE = ("--scheduler", "make", "pip")


def commands_of(page):
    """Return the rotcli commands of a page's indented and fenced blocks, in order."""
    lines = page.read_text(encoding="utf-8").splitlines()
    found, fenced = [], False
    for line in lines:
        if line.startswith("```"):
            fenced = not fenced
            continue
        if (fenced or line.startswith("    ")) and re.match(r"\s*(rotcli|cd) ", line):
            found.append(line.strip())
    return found


def links_of(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return [link for link in re.findall(r"\]\(([^)#]+)", text) if "://" not in link]


@pytest.mark.parametrize("page", PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_the_commands_of_a_page_have_the_options_that_they_use(page):
    known = dict(leaf_commands())
    for line in commands_of(page):
        words = shlex.split(line, comments=True)[1:]
        command = known.get(words[0] if words else "") or known.get(" ".join(words[:2]))
        options = {option for p in command.params for option in p.opts} if command else set()
        given = {word for word in words if word.startswith("-") and word != "-"}
        assert given <= options | {"--help", "--version"}, line


# Pages of two to four seconds whose commands have examples in their help, which run every time.
_LONG = ("srins.md", "noise.md", "is-my-result-as-good-as-my-imu.md", "analyse-a-fleet.md")
RUN = [
    pytest.param(page, marks=pytest.mark.campaign if page.name in _LONG else ()) for page in PAGES
]


@pytest.mark.parametrize("page", RUN, ids=lambda p: str(p.relative_to(ROOT)))
def test_the_commands_of_a_page_run_in_order(page, rotcli, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for line in commands_of(page):
        words = shlex.split(line, comments=True)
        if any(word in line for word in _NEEDS_MORE):
            continue
        if words[0] == "cd":
            monkeypatch.chdir(words[1])
            continue
        done = rotcli(*words[1:])
        assert done.status == 0, (line, done.err)


@pytest.mark.parametrize(
    "page",
    [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))],
    ids=lambda p: str(p.relative_to(ROOT)),
)
def test_the_links_of_a_page_lead_somewhere(page):
    for link in links_of(page):
        assert (page.parent / link).exists(), link


def test_the_notebook_page_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = (DOCS / "tutorial" / "notebook.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    names = {}
    for block in blocks:
        exec(block, names)
    assert json.loads(Path("full.json").read_text())["kind"] == "navigation"
    assert Path("errors.png").stat().st_size > 10_000


def test_the_readme_is_short():
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120


@pytest.mark.parametrize(("path", "text"), pages().items(), ids=lambda p: getattr(p, "name", ""))
def test_a_generated_page_is_up_to_date(path, text):
    assert path.read_text(encoding="utf-8") == text, "run python -m tests.reference_pages"


@pytest.mark.parametrize("topic", TOPICS)
def test_help_prints_the_page_of_a_topic(topic, rotcli):
    page = (DOCS / "reference" / f"{topic}.md").read_text(encoding="utf-8")
    assert rotcli("help", topic).out == page
    assert topic in rotcli("help").out


def test_every_key_of_the_rig_is_described():
    text = (DOCS / "reference" / "rig.md").read_text(encoding="utf-8")
    common = text.split("## How a log is written")[1].split("\n## ")[0]
    for section, keys in KEYS.items():
        part = text.split(f"## `[{section}]`")[1].split("\n## ")[0]
        part += common if section in ("imu", "table", "reference") else ""
        for key in keys:
            assert f"`{key}`" in part or f"`{key} =" in part, f"[{section}] {key}"


def test_every_key_of_a_result_is_described(rotcli, turning):
    text = (DOCS / "reference" / "results.md").read_text(encoding="utf-8")
    logs = (turning / "imu.parquet", turning / "table.parquet")
    calibration, navigation = turning / "c.json", turning / "n.json"
    assert rotcli("calibrate", *logs, "-o", calibration).status == 0
    assert rotcli("navigate", *logs, "--calibration", calibration, "-o", navigation).status == 0
    for path in (calibration, navigation):
        for key in json.loads(path.read_text()):
            assert f"`{key}`" in text, key


def test_the_scenario_that_is_shown_plays(rotcli, tmp_path):
    page = DOCS / "reference" / "rig.md"
    text = page.read_text(encoding="utf-8").split("\n## A scenario")[1]
    shown = "\n".join(line for line in text.splitlines() if line.startswith("    ") or not line)
    path = tmp_path / "scenario.toml"
    path.write_text(textwrap.dedent(shown))
    outcome = rotcli("simulate", "--scenario", path, "-o", tmp_path / "run")
    assert outcome.status == 0, outcome.err
    assert "421 s" not in outcome.err  # 60 + 1 + 60 + 1 + 300
    assert "422 s of NAV440" in outcome.err
