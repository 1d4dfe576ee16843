"""Mutants of a module: one changed operator, sign, function, transpose or number each."""

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass

# Operators and functions that are exchanged for each other.
_OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
}
_COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE,
    ast.GtE: ast.Lt,
    ast.Gt: ast.LtE,
    ast.LtE: ast.Gt,
}
_FUNCTIONS = {"sin": "cos", "cos": "sin", "arcsin": "arccos", "minimum": "maximum"}
_FUNCTIONS |= {"maximum": "minimum", "min": "max", "max": "min", "cumsum": "cumprod"}
_FACTOR = 1.01  # of a number; physics is tested to better than a hundredth


@dataclass(frozen=True)
class Mutant:
    """A changed module: `name` is FUNCTION: BEFORE -> AFTER, unique within the module."""

    name: str
    line: int
    source: str


def mutants(source: str) -> list[Mutant]:
    """Return every mutant of a module."""
    tree = ast.parse(source)
    found: dict[str, Mutant] = {}
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef):
            continue
        for node, changed in _changes(function):
            before = ast.unparse(node)
            mutated = ast.unparse(_replace(tree, node, changed))
            name = f"{function.name}: {before} -> {ast.unparse(changed)}"
            found.setdefault(name, Mutant(name, node.lineno, mutated))
    return list(found.values())


def _replace(tree: ast.Module, node: ast.expr, changed: ast.expr) -> ast.Module:
    """Return a copy of the tree with one expression replaced."""
    place = (node.lineno, node.col_offset, node.end_col_offset, type(node))

    class Swap(ast.NodeTransformer):
        def visit(self, other: ast.AST) -> ast.AST:
            if isinstance(other, ast.expr):
                here = (other.lineno, other.col_offset, other.end_col_offset, type(other))
                if here == place:
                    return ast.copy_location(changed, other)
            return self.generic_visit(other)

    mutated: ast.Module = Swap().visit(copy.deepcopy(tree))
    return ast.fix_missing_locations(mutated)


def _changes(function: ast.FunctionDef) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Yield (expression, changed expression); texts of messages and type hints stay."""
    for node in ast.walk(ast.Module(_statements(function), [])):
        if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            yield node, ast.BinOp(node.left, _OPERATORS[type(node.op)](), node.right)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
            if not isinstance(node.operand, ast.Constant) or node.operand.value != 1:
                yield node, node.operand
        elif isinstance(node, ast.Compare) and type(node.ops[0]) in _COMPARISONS:
            ops = [_COMPARISONS[type(node.ops[0])](), *node.ops[1:]]
            yield node, ast.Compare(node.left, ops, node.comparators)
        elif isinstance(node, ast.Attribute) and node.attr in _FUNCTIONS:
            yield node, ast.Attribute(node.value, _FUNCTIONS[node.attr], node.ctx)
        elif isinstance(node, ast.Attribute) and node.attr == "T":
            yield node, node.value
        elif isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value:
            yield node, ast.Constant(_FACTOR * node.value)


def _statements(function: ast.FunctionDef) -> list[ast.stmt]:
    """Return the statements of a body without docstring, and without those that only raise."""
    return [
        statement
        for statement in function.body
        if not isinstance(statement, ast.Raise)
        and not (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant))
    ]
