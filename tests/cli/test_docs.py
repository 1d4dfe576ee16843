"""What the documentation says of the rig and the scenario is true."""

import textwrap
from pathlib import Path

from rotcli.rig.keys import KEYS

DOCS = Path(__file__).parents[2] / "docs"


def test_every_key_of_the_rig_is_described():
    text = (DOCS / "reference" / "rig.md").read_text(encoding="utf-8")
    for section, keys in KEYS.items():
        part = text.split(f"## `[{section}]`")[1].split("\n## ")[0]
        for key in keys:
            assert f"`{key}`" in part or f"`{key} =" in part, f"[{section}] {key}"


def test_the_scenario_that_is_shown_plays(rotcli, tmp_path):
    text = (DOCS / "reference" / "rig.md").read_text(encoding="utf-8").split("\n## A scenario")[1]
    shown = "\n".join(line for line in text.splitlines() if line.startswith("    ") or not line)
    path = tmp_path / "scenario.toml"
    path.write_text(textwrap.dedent(shown))
    outcome = rotcli("simulate", "--scenario", path, "-o", tmp_path / "run")
    assert outcome.status == 0, outcome.err
    assert "421 s" not in outcome.err  # 60 + 1 + 60 + 1 + 300
    assert "422 s of NAV440" in outcome.err
