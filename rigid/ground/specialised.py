"""A surface law with its numbers written into its source: the same arithmetic in less time.

For loops that evaluate one law under one foot very often (`coupling.robot.FootForces`). Each function of
`rigid.ground.law_functions` is a list of statements that ends with the only `return`. So its source can be copied with
p[k] replaced by a constant. A term that is then multiplied by 0 is left out, and so is a factor or exponent of 1. So is
a condition whose answer is known because the depth is above 0, and a variable that nothing reads. For finite numbers
that changes no bit, but for the sign of a zero. Half of the terms of 3D-RFT under a flat foot are such.
"""

import ast
import inspect
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from .laws import SurfaceLaw

__all__ = ["Written", "written"]


@dataclass(frozen=True)
class Written:
    """Source of a law: statements to execute, then an expression. Depths [m] and rate [m/s] positive downwards."""

    loading_lines: tuple[str, ...]
    loading: str  # Force of loading [N] at the name `top`, above 0
    rate_lines: tuple[str, ...]
    rate_force: str  # Force [N] at the names `depth`, above 0, and `rate`; "0.0" of a law that ignores the rate


def written(law: SurfaceLaw, numbers: Sequence[float]) -> Written:
    """`law` with the numbers p that `SurfaceLaw.numbers` returns."""
    return _written(law.loading, law.rate_force, tuple(map(float, numbers)))


@lru_cache(maxsize=1024)
def _written(loading: Any, rate_force: Any, numbers: tuple[float, ...]) -> Written:
    return Written(*_body(loading, numbers, "a_", {"depth": "top"}), *_body(rate_force, numbers, "b_", {}))


def _body(
    function: Any, numbers: tuple[float, ...], prefix: str, arguments: dict[str, str]
) -> tuple[tuple[str, ...], str]:
    """Lines of a law's function with its numbers, `prefix` before its variables' names; what it returns."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    rename = _WithNumbers(numbers, prefix, {"depth": "depth", "rate": "rate"} | arguments)
    simpler = _Simpler(tree)
    statements: list[ast.stmt] = []
    for statement in tree.body[1:]:  # the first: docstring
        made = simpler.visit(rename.visit(statement))
        statements += made if isinstance(made, list) else [made] if made is not None else []
    statements = _read_later(statements)
    last = statements.pop()
    assert isinstance(last, ast.Return) and last.value is not None
    lines = [line for statement in statements for line in ast.unparse(statement).splitlines()]
    return tuple(lines), ast.unparse(last.value)


class _WithNumbers(ast.NodeTransformer):
    """p[k] becomes a constant, an argument another name, and each variable gets a prefix."""

    def __init__(self, numbers: tuple[float, ...], prefix: str, arguments: dict[str, str]) -> None:
        self.numbers, self.prefix, self.arguments = numbers, prefix, arguments

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        assert isinstance(node.slice, ast.Constant)
        return ast.Constant(self.numbers[int(node.slice.value)])  # type: ignore[arg-type]

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return ast.Name(self.arguments.get(node.id, self.prefix + node.id), node.ctx)


class _Simpler(ast.NodeTransformer):
    """Leaves out what changes no finite number: terms of 0, factors and exponents of 1, powers of 0, known answers."""

    def __init__(self, tree: ast.FunctionDef) -> None:
        stores = [node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
        self.once = {name for name in stores if stores.count(name) == 1}
        self.positive, self.known = {"depth", "top"}, dict[str, ast.expr]()

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return self.known.get(node.id, node) if isinstance(node.ctx, ast.Load) else node

    def visit_Assign(self, node: ast.Assign) -> ast.stmt | None:
        node.value, (target,) = self.visit(node.value), node.targets
        assert isinstance(target, ast.Name)
        self.positive.discard(target.id)
        value = node.value
        if isinstance(value, ast.BinOp) and isinstance(value.op, ast.Div) and (_value(value.right) or 0.0) > 0.0:
            value = value.left
        if isinstance(value, ast.Name) and value.id in self.positive:
            self.positive.add(target.id)
        if _value(node.value) is not None and target.id.split("_", 1)[1] in self.once:
            self.known[target.id] = node.value
            return None
        return node

    def visit_If(self, node: ast.If) -> Any:
        test = node.test
        assert isinstance(test, ast.Compare) and isinstance(test.left, ast.Name) and not node.orelse
        if test.left.id in self.positive and _value(test.comparators[0]) == 0.0:
            return None if isinstance(test.ops[0], ast.Lt) else [self.visit(each) for each in node.body]
        names = [each for each in ast.walk(node) if isinstance(each, ast.Name)]
        self.positive -= {each.id for each in names if isinstance(each.ctx, ast.Store)}
        return self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        left, right = self.visit(node.left), self.visit(node.right)
        if isinstance(node.op, ast.Add) and 0.0 in (found := [_value(left), _value(right)]):
            return right if found[0] == 0.0 else left
        if isinstance(node.op, ast.Mult) and (found := [_value(left), _value(right)]) != [None, None]:
            if 0.0 in found:
                return ast.Constant(0.0)
            if 1.0 in found:
                return right if found[0] == 1.0 else left
        if isinstance(node.op, ast.Pow) and _value(right) in (0.0, 1.0):
            return left if _value(right) == 1.0 else ast.Constant(1.0)
        if isinstance(node.op, ast.Sub) and _value(left) is not None and _value(right) is not None:
            return ast.Constant(_value(left) - _value(right))
        return ast.BinOp(left, node.op, right)


def _value(node: ast.expr) -> Any:
    """The number that a constant is; None otherwise."""
    return node.value if isinstance(node, ast.Constant) else None


def _read_later(statements: Sequence[ast.stmt]) -> list[ast.stmt]:
    """`statements` without assignments to variables that none of those after reads."""
    kept: list[ast.stmt] = []
    read: set[str] = set()
    for statement in reversed(statements):
        names = [node for node in ast.walk(statement) if isinstance(node, ast.Name)]
        stored = {node.id for node in names if isinstance(node.ctx, ast.Store)}
        if stored and not stored & read:
            continue
        if isinstance(statement, ast.Assign):
            read -= stored
        read |= {node.id for node in names if isinstance(node.ctx, ast.Load)}
        kept.append(statement)
    return kept[::-1]
