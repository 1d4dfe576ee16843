"""The command blocks of the pages on export, certificate and fleet run in order."""

import re
import shlex
from pathlib import Path

import pytest

from tests.cli.in_process import run

DOCS = Path(__file__).parents[3] / "docs"
PAGES = ("export-to-other-programs", "write-a-certificate", "analyse-a-fleet")


@pytest.mark.parametrize("page", PAGES)
def test_the_commands_of_the_page_run(page, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = (DOCS / "how-to" / f"{page}.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    lines = [line for language, block in blocks if not language for line in block.splitlines()]
    assert len(lines) >= 4
    for line in lines:
        words = shlex.split(line)
        assert words[0] == "rotcli"
        done = run(*words[1:])
        assert done.returncode == 0, f"{line}: {done.stderr}"


def test_every_format_is_on_the_pages() -> None:
    from rotcli.cli.sharing.export import FORMATS

    text = (DOCS / "how-to" / "export-to-other-programs.md").read_text(encoding="utf-8")
    for name in FORMATS:
        assert f"`{name}`" in text


def test_the_toml_blocks_are_valid_specs(tmp_path) -> None:
    from rotcli.files.spec import read_spec

    text = (DOCS / "how-to" / "write-a-certificate.md").read_text(encoding="utf-8")
    block = next(b for b in re.findall(r"```toml\n(.*?)```", text, re.DOTALL) if "limits" in b)
    path = tmp_path / "spec.toml"
    path.write_text(block)
    assert set(read_spec(str(path)).limits) == {"bias_z", "gyro_x.random_walk"}
