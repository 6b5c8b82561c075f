"""The functions of a surface law with its numbers written into their source: the same arithmetic in less time.

For loops that evaluate one law under one foot very often (`coupling.robot.FootForces`). Each function of
`rigid.ground.law_functions` is a list of statements that ends with the only `return`. So its source can be copied with
p[k] replaced by a constant. A term that is then multiplied by 0 is left out, as is a factor or exponent of 1: for
finite numbers that changes no bit, but for the sign of a zero. Half of the terms of 3D-RFT under a flat foot are such.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from .laws import SurfaceLaw

__all__ = ["Specialised", "specialised"]


@dataclass(frozen=True)
class Specialised:
    """A law with its numbers; depth [m] and rate [m/s] are positive downwards, depth above 0, forces in N."""

    loading: Callable[[float], float]
    rate_force: Callable[[float, float], float]
    force: Callable[[float, float], float]
    """Of depth and rate, at the deepest depth: loading + rate_force."""


def specialised(law: SurfaceLaw, numbers: Sequence[float]) -> Specialised:
    """`law` with the numbers p that `SurfaceLaw.numbers` returns."""
    return _specialised(law.loading, law.rate_force, tuple(map(float, numbers)))


@lru_cache(maxsize=1024)
def _specialised(loading: Any, rate_force: Any, numbers: tuple[float, ...]) -> Specialised:
    first, at_rest = _body(loading, numbers, "a_")
    second, moving = _body(rate_force, numbers, "b_")
    whole = ast.BinOp(at_rest, ast.Add(), moving)
    return Specialised(
        loading=_function(("depth",), first, at_rest),
        rate_force=_function(("depth", "rate"), second, moving),
        force=_function(("depth", "rate"), [*first, *second], _Simpler().visit(whole)),
    )


def _function(arguments: Sequence[str], body: list[ast.stmt], result: ast.expr) -> Any:
    """The function of these arguments that executes `body` and returns `result`."""
    lines = [*(ast.unparse(statement) for statement in body), f"return {ast.unparse(result)}"]
    names: dict[str, Any] = {}
    source = f"def function({', '.join(arguments)}):\n" + textwrap.indent("\n".join(lines), "    ")
    exec(compile(source, "<specialised law>", "exec"), names)  # of our own functions and of floats alone
    return names["function"]


def _body(function: Any, numbers: tuple[float, ...], prefix: str) -> tuple[list[ast.stmt], ast.expr]:
    """Statements of a law's function with its numbers, `prefix` before its variables' names; what it returns."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    rename = _WithNumbers(numbers, prefix)
    statements = [_Simpler().visit(rename.visit(statement)) for statement in tree.body[1:]]  # the first: docstring
    last = statements.pop()
    assert isinstance(last, ast.Return) and last.value is not None
    return statements, last.value


class _WithNumbers(ast.NodeTransformer):
    """p[k] becomes a constant, variables get a prefix; depth and rate stay."""

    def __init__(self, numbers: tuple[float, ...], prefix: str) -> None:
        self.numbers, self.prefix = numbers, prefix

    def visit_Subscript(self, node: ast.Subscript) -> ast.expr:
        assert isinstance(node.slice, ast.Constant)
        return ast.Constant(self.numbers[int(node.slice.value)])  # type: ignore[arg-type]

    def visit_Name(self, node: ast.Name) -> ast.expr:
        kept = node.id in ("depth", "rate")
        return node if kept else ast.Name(self.prefix + node.id, node.ctx)


class _Simpler(ast.NodeTransformer):
    """Leaves out what changes no finite number: terms of 0, factors and exponents of 1, powers of 0."""

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
