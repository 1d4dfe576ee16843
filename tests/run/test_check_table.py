"""The table of checks: one row per code, the documentation generated, severities applied."""

import ast
from pathlib import Path

import pytest

import rotcli
from rotcli.errors import LogError
from rotcli.run.checks import CHECK_BY_CODE, CHECKS, COMMANDS, judge, to_markdown
from rotcli.run.findings import Finding

ROOT = Path(rotcli.__file__).parent


def _codes_in_the_source():
    """Yield the codes of findings and check errors raised by the analysis of a run."""
    for folder in ("run", "calibrate"):
        for path in (ROOT / folder).glob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
                    continue
                at = {"Finding": 0, "CheckError": 1}.get(node.func.id)
                if at is not None and len(node.args) > at:
                    code = node.args[at]
                    if isinstance(code, ast.Constant):
                        yield code.value


def test_every_code_of_the_source_is_a_row_of_the_table_and_no_row_is_listed_twice():
    assert set(_codes_in_the_source()) <= set(CHECK_BY_CODE)
    assert len(CHECK_BY_CODE) == len(CHECKS)


def test_every_check_is_made_by_some_command_and_its_limit_has_a_reason():
    for check in CHECKS:
        assert any(check.severity(command) for command in COMMANDS), check.code
        assert check.compares, check.code
        assert check.limit, check.code


def test_the_reference_page_is_generated_from_the_table():
    page = Path(__file__).parents[2] / "docs" / "reference" / "checks.md"
    assert page.read_text() == to_markdown(), (
        "python -m rotcli.run.checks > docs/reference/checks.md"
    )


def test_a_command_takes_the_severity_from_the_table():
    finding = Finding("gravity-size", "imu.csv: too large", where="accel")
    assert [f.severity for f in judge("calibrate", [finding])] == ["warning"]
    with pytest.raises(LogError, match=r"^imu\.csv: too large$"):
        judge("navigate", [finding])
    assert [f.severity for f in judge("navigate", [finding], lenient=True)] == ["warning"]


def test_a_finding_of_a_check_that_the_command_does_not_make_is_dropped():
    assert judge("observe", [Finding("attitude-tilt", "imu.csv: 4 deg")]) == ()


def test_a_code_without_a_row_is_a_defect():
    with pytest.raises(KeyError):
        judge("observe", [Finding("no-such-check", "x")])
