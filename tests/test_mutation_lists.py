"""The list of the mutation campaign names modules and tests that exist."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
LIST = ROOT / "tests" / "campaigns" / "mutate" / "mathematics.toml"


def test_every_module_of_the_mathematics_has_tests_that_exist():
    table = tomllib.loads(LIST.read_text(encoding="utf-8"))
    for folder, modules in table.items():
        for name, tests in modules.items():
            assert (ROOT / "rotcli" / folder / f"{name}.py").exists(), name
            assert tests
            for test in tests:
                assert (ROOT / "tests" / test).exists(), test
