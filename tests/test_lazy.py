"""Lazy imports: a block loads nothing, and each of its names is a module that exists."""

import ast
import importlib.util
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import rotcli

PACKAGE = Path(rotcli.__file__).parent


def _blocks(path):
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.With) and "lazily" in ast.unparse(node.items[0]):
            yield from node.body


def _modules(path):
    for statement in _blocks(path):
        assert isinstance(statement, ast.Import | ast.ImportFrom), f"{path}: {statement.lineno}"
        if isinstance(statement, ast.Import):
            yield from (alias.name for alias in statement.names)
        else:
            yield from (f"{statement.module}.{alias.name}" for alias in statement.names)


def test_every_name_of_a_lazy_block_is_a_module():
    found = {(path, name) for path in PACKAGE.rglob("*.py") for name in _modules(path)}
    assert len(found) > 50
    optional = {"distributed", "rosbags", "openpyxl"}
    for path, name in found:
        if name.split(".")[0] not in optional:
            assert importlib.util.find_spec(name) is not None, f"{path}: {name} is no module"


def test_the_command_line_imports_nothing_within_functions():
    for path in (PACKAGE / "cli").rglob("*.py"):
        for function in ast.walk(ast.parse(path.read_text())):
            if isinstance(function, ast.FunctionDef):
                inner = [
                    n for n in ast.walk(function) if isinstance(n, ast.Import | ast.ImportFrom)
                ]
                assert not inner, f"{path}: line {inner[0].lineno}: move it to the top"


def _module(tmp_path, monkeypatch, text):
    (tmp_path / "subject.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "subject", raising=False)
    return importlib.import_module("subject")


def test_a_block_loads_at_first_use_only(tmp_path, monkeypatch):
    (tmp_path / "heavy").mkdir()
    (tmp_path / "heavy" / "__init__.py").write_text("")
    (tmp_path / "heavy" / "part.py").write_text("NUMBER = 3\n")
    text = (
        "from rotcli.lazy import lazily\n"
        "with lazily():\n"
        "    import heavy\n    import heavy.part as one\n    from heavy import part\n"
        "def use():\n    return part.NUMBER\n"
    )
    subject = _module(tmp_path, monkeypatch, text)
    assert "heavy" not in sys.modules
    assert not hasattr(subject.part, "__wrapped__")  # an inspection is no use
    assert "heavy" not in sys.modules
    assert subject.use() == 3
    assert subject.one.NUMBER == 3
    assert "heavy.part" in sys.modules
    monkeypatch.setattr(subject.part, "NUMBER", 4)  # a change is one of the module
    assert sys.modules["heavy.part"].NUMBER == 4
    for name in ("heavy", "heavy.part"):
        monkeypatch.delitem(sys.modules, name)


def test_a_missing_module_is_an_import_error_at_its_use(tmp_path, monkeypatch):
    text = "from rotcli.lazy import lazily\nwith lazily():\n    import no_such_module\n"
    subject = _module(tmp_path, monkeypatch, text)
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        _ = subject.no_such_module.name


def test_imports_of_another_thread_are_not_deferred(tmp_path, monkeypatch):
    (tmp_path / "plain.py").write_text("VALUE = 1\n")
    text = (
        "import threading\nfrom rotcli.lazy import lazily\n"
        "found = []\n"
        "def other():\n    exec('import plain; found.append(plain)', {'found': found})\n"
        "with lazily():\n"
        "    thread = threading.Thread(target=other); thread.start(); thread.join()\n"
    )
    subject = _module(tmp_path, monkeypatch, text)
    assert type(subject.found[0]) is type(threading)


def test_help_imports_neither_numpy_nor_a_capability():
    program = (
        "import sys\nsys.argv = ['rotcli', '--help']\nfrom rotcli.cli.main import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'scipy', 'pandas', 'pyarrow', 'matplotlib', 'jinja2', 'tomlkit'}\n"
        "heavy |= {'rotcli.files.documents', 'rotcli.rig.rig', 'multiprocessing'}\n"
        "print(*sorted(heavy & set(sys.modules)), file=sys.stderr)\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stderr.strip()) == (0, "")
