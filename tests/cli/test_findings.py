"""Options belong to the command line: packages below it name none, codes of findings do."""

import ast
import pickle
import re
from pathlib import Path

import pytest

import rotcli
from rotcli.cli.findings import OPTIONS, with_option
from rotcli.cli.main import main
from rotcli.errors import CodedText, LogError

PACKAGE = Path(rotcli.__file__).parent
_OPTION = re.compile(r"(?<![-\w])--[a-z]")
# Options of other programs: Chromium, and the converter of ArduPilot's logs.
_OF_OTHERS = {"certificate/pdf.py", "logs/container/encoding.py"}


def _texts(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    with_docstring = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, with_docstring) and node.body and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        text = isinstance(node, ast.Constant) and isinstance(node.value, str)
        if text and id(node) not in docstrings:
            yield node.value


def test_no_text_below_the_command_line_names_an_option():
    named = []
    for path in PACKAGE.rglob("*.py"):
        name = path.relative_to(PACKAGE).as_posix()
        other = name.startswith("cli/") or name in _OF_OTHERS
        if not other and _OPTION.search(path.read_text(encoding="utf-8")):
            named += [f"{name}: {text}" for text in _texts(path) if _OPTION.search(text)]
    assert named == []


def test_every_code_with_an_option_is_used_by_a_finding():
    source = "".join(
        path.read_text(encoding="utf-8")
        for path in PACKAGE.rglob("*.py")
        if not path.is_relative_to(PACKAGE / "cli")
    )
    assert [code for code in OPTIONS if f'"{code}"' not in source] == []


def test_errors_and_warnings_get_the_option_of_their_code():
    error = LogError("imu.csv", "the file has 9 bytes; raise the limit", code="log-size")
    assert with_option(error).endswith("raise the limit (option: --max-bytes)")
    warning = pickle.loads(pickle.dumps(CodedText("height-diverges", "use the height hold")))
    assert with_option(warning) == "use the height hold (option: --height hold)"
    assert with_option("a text without a code") == "a text without a code"


def test_a_warning_on_standard_error_names_the_option_and_the_result_does_not(capsys, tmp_path):
    output = tmp_path / "b.json"
    with pytest.raises(SystemExit) as stop:
        main(["budget", "--gyro-bias", "10,0,0", "--rate", "10", "-o", str(output)])
    assert stop.value.code == 0
    assert "no white noise (options: --imu, --angle-random-walk, --rig)" in capsys.readouterr().err
    assert "no white noise" in output.read_text()
    assert "--" not in output.read_text()
