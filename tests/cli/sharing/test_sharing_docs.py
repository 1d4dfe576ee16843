"""The pages on export and certificates name what exists; test_docs runs their commands."""

import re
from pathlib import Path

DOCS = Path(__file__).parents[3] / "docs"


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
