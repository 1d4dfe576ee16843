"""The layout of the code: sizes, imports at the top, no import circle, types of the command line.

The layers themselves are contracts of import-linter (pyproject.toml).
"""

import ast
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
MAX_MODULES = 15  # in a folder, without its __init__.py
MAX_MODULE_LINES = 350
MAX_FUNCTION_LINES = 60
# Imports inside functions: so that an interrupt during these imports is reported in one line.
_ALLOWED = {("rotcli/__main__.py", "main")}


def _modules(*folders: str) -> list[Path]:
    return sorted(
        path
        for folder in folders
        for path in (ROOT / folder).rglob("*.py")
        if "__pycache__" not in path.parts
    )


MODULES = _modules("rotcli", "tests")
PROGRAM = [path for path in MODULES if path.is_relative_to(ROOT / "rotcli")]


class _Function(NamedTuple):
    name: str
    lines: int
    imports: bool


class _Module(NamedTuple):
    """What the tests ask of a module; to keep the trees costs the garbage collector seconds."""

    functions: list[_Function]
    requested: list[tuple[str, tuple[str, ...]]]  # at run time: module, names from it
    makes_dataclasses: bool


@cache
def _module(path: Path) -> _Module:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [
        _Function(
            node.name,
            (node.end_lineno or 0) - node.lineno + 1,
            any(isinstance(n, ast.Import | ast.ImportFrom) for n in _statements(node)),
        )
        for node in _functions(tree)
    ]
    requested: list[tuple[str, tuple[str, ...]]] = []
    for node in _run_time_nodes(tree):
        if isinstance(node, ast.Import):
            requested += [(alias.name, ()) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            requested.append((node.module, tuple(alias.name for alias in node.names)))
    makes = any(
        isinstance(node, ast.ImportFrom)
        and node.module == "dataclasses"
        and any(alias.name == "dataclass" for alias in node.names)
        for node in _statements(tree)
    )
    return _Module(functions, requested, makes)


def _tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def _statements(tree: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements below a node; walking expressions as well takes much longer."""
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        for node in getattr(tree, part, ()):
            yield node
            yield from _statements(node)


def _functions(tree: ast.AST) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    for node in _statements(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield node


def test_no_folder_has_too_many_modules():
    modules = Counter(_name(path.parent) for path in MODULES if path.name != "__init__.py")
    assert {folder: n for folder, n in modules.items() if n > MAX_MODULES} == {}


def test_no_module_is_too_long():
    lines = {_name(path): len(path.read_text(encoding="utf-8").splitlines()) for path in MODULES}
    assert {path: n for path, n in lines.items() if n > MAX_MODULE_LINES} == {}


def test_no_function_is_too_long():
    lines = {
        (_name(path), function.name): function.lines
        for path in MODULES
        for function in _module(path).functions
    }
    assert {where: n for where, n in lines.items() if n > MAX_FUNCTION_LINES} == {}


def test_imports_are_at_the_top_of_a_module():
    inside = {
        (_name(path), function.name)
        for path in PROGRAM
        for function in _module(path).functions
        if function.imports
    }
    assert inside == _ALLOWED


def test_classes_of_data_are_made_without_a_compiler():
    wrong = [_name(path) for path in PROGRAM if _module(path).makes_dataclasses]
    assert wrong == ["rotcli/dataclass.py"], "use rotcli.dataclass: it starts faster"


def test_no_module_imports_itself_through_others():
    graph = _imports()
    done: set[str] = set()
    for start in graph:
        assert (circle := _circle(start, graph, [], done)) is None, " -> ".join(circle)


def _imports() -> dict[str, set[str]]:
    """Return which modules each module imports, lazily or at once; not for type checkers only."""
    names = {}
    for path in PROGRAM:
        parts = path.relative_to(ROOT).with_suffix("").parts
        names[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    graph = {}
    for name, path in names.items():
        requested: set[str] = set()
        for module, parts in _module(path).requested:
            below = {f"{module}.{part}" for part in parts}
            requested |= below & names.keys() or {module}
        graph[name] = requested & names.keys()
    return graph


def _run_time_nodes(tree: ast.AST) -> Iterator[ast.AST]:
    for part in ("body", "orelse", "finalbody", "handlers", "cases"):
        for node in getattr(tree, part, ()):
            if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
                continue
            yield node
            yield from _run_time_nodes(node)


def _circle(
    module: str, graph: dict[str, set[str]], above: list[str], done: set[str]
) -> list[str] | None:
    """Return a circle through or below a module, None where there is none."""
    if module in above:
        return [*above[above.index(module) :], module]
    if module in done:
        return None
    for below in sorted(graph[module]):
        if (found := _circle(below, graph, [*above, module], done)) is not None:
            return found
    done.add(module)
    return None


@pytest.mark.parametrize("path", [p for p in PROGRAM if "cli" in p.parts], ids=_name)
def test_the_command_line_is_typed(path):
    for node in _functions(_tree(path)):
        arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
        arguments += [a for a in (node.args.vararg, node.args.kwarg) if a is not None]
        hints = [a.annotation for a in arguments if a.annotation] + [node.returns or ast.Pass()]
        assert not any("Any" in ast.unparse(hint) for hint in hints), f"{node.name}, {node.lineno}"


@pytest.mark.parametrize("path", [p for p in PROGRAM if "cli" in p.parts], ids=_name)
def test_classes_of_options_work_with_the_oldest_click(path):
    # click 8.1 to 8.3.1, which pyproject.toml allows, has no generic ParamType.
    for node in _statements(_tree(path)):
        bases = node.bases if isinstance(node, ast.ClassDef) else []
        assert not any(isinstance(base, ast.Subscript) for base in bases), ast.unparse(node)[:80]
