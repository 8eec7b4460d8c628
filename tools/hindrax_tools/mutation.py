"""Single mutations of one module, each against named tests: what survives is a line that no test holds.

No file is changed: a process of its own imports the mutant in the place of the module. So only tests that call the
module in their own process can kill a mutant. `hindrax_tools.mutation_table` is the command.
"""

import ast
import contextlib
import importlib.util
import os
import random
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import hypothesis
import pytest

SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.And: ast.Or, ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
DROPPED = (ast.Not, ast.USub)
DECLARES = ("knob", "fact")
"""Declare a parameter: its default and limits stand in the reference pages, which a test compares with the code."""
ASSERTS = "strict"
"""An argument of `zip` that asserts what is so: without it nothing changes."""
PROFILE = "mutation"
"""Settings of hypothesis."""
WITHOUT = ("-p", "no:cacheprovider", "-p", "no:faulthandler")
"""Plugins of pytest that serve no mutant."""
PATIENCE = 5.0
LEAST_PATIENCE_S = 10.0
"""Tests that take so many times longer with a mutant than without it are ended, and the mutant counts as killed."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """A change of one node: where, what it is there now and in the mutant, and how the line reads in the mutant."""

    line: int
    before: str
    after: str
    reads: str


class _Mutate(ast.NodeTransformer):
    """Changes the node of one number, counted in the order of the source; -1: none. Lists what it passes."""

    def __init__(self, source: str, wanted: int = -1) -> None:
        self._lines, self._wanted, self.found = source.splitlines(), wanted, list[Mutant]()

    def visit(self, node: ast.AST) -> ast.AST:
        """Change this node if it is the one; then what is below it."""
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module) and ast.get_docstring(node):
            docstring, *node.body = node.body
            if isinstance(node, ast.FunctionDef):
                node.args = self.visit(node.args)  # type: ignore[assignment]  # arguments stay arguments
            node.body = [docstring, *self._all(node.body)]
            return node
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in DECLARES:
            return node
        if isinstance(node, ast.keyword) and node.arg == ASSERTS:
            return node
        if isinstance(node, ast.AnnAssign | ast.arg):  # annotations are no code
            if isinstance(node, ast.AnnAssign) and node.value is not None:
                node.value = self.visit(node.value)  # type: ignore[assignment]  # an expression stays one
            return node
        for other in _others(node):
            self.found.append(self._mutant(node, other))
            if len(self.found) - 1 == self._wanted:
                return other
        return self.generic_visit(node)

    def _mutant(self, node: ast.AST, other: ast.AST) -> Mutant:
        # Columns are those of UTF-8. A node of the grammar that is mutated has a place.
        first, last = self._lines[node.lineno - 1].encode(), self._lines[node.end_lineno - 1].encode()  # type: ignore[attr-defined]
        left, right = first[: node.col_offset].decode(), last[node.end_col_offset :].decode()  # type: ignore[attr-defined]
        before, after = ast.unparse(node), ast.unparse(other)
        reads = f"{left}{after}{right}".strip()
        return Mutant(node.lineno, before, after, f"pass  # {before}" if isinstance(other, ast.Pass) else reads)  # type: ignore[attr-defined]

    def _all(self, body: list[ast.stmt]) -> list[ast.stmt]:
        return [self.visit(one) for one in body]  # type: ignore[misc]  # a statement stays one


def _others(node: ast.AST) -> Iterator[ast.AST]:
    """What a mutant has in the place of a node."""
    match node:
        case ast.Compare(ops=[op]) if type(op) in SWAPS:
            yield ast.copy_location(ast.Compare(node.left, [SWAPS[type(op)]()], node.comparators), node)  # type: ignore[list-item]
        case ast.BoolOp():
            yield ast.copy_location(ast.BoolOp(SWAPS[type(node.op)](), node.values), node)  # type: ignore[arg-type]
        case ast.BinOp() if type(node.op) in SWAPS:
            yield ast.copy_location(ast.BinOp(node.left, SWAPS[type(node.op)](), node.right), node)  # type: ignore[arg-type]
        case ast.UnaryOp() if isinstance(node.op, DROPPED):
            yield node.operand
        case ast.IfExp():
            yield node.orelse
            yield node.body
        case ast.Constant(value=bool()):
            yield ast.copy_location(ast.Constant(not node.value), node)
        case ast.Constant(value=int() | float() as number):
            yield ast.copy_location(ast.Constant(number + 1), node)
        case ast.Expr(value=ast.Call()) | ast.AugAssign() | ast.Assign(targets=[ast.Attribute()]):
            yield ast.copy_location(ast.Pass(), node)


def mutants(source: str) -> list[Mutant]:
    """Every mutant of a source, in its order."""
    mutate = _Mutate(source)
    mutate.visit(ast.parse(source))
    return mutate.found


def mutated(source: str, number: int) -> ast.Module:
    """The tree of the mutant of this number; the source's own for -1."""
    tree = _Mutate(source, number).visit(ast.parse(source))
    assert isinstance(tree, ast.Module)
    return ast.fix_missing_locations(tree)


class MutatedModule:
    """The tests of one module, run in a process of its own each time."""

    def __init__(self, module: str, tests: Sequence[str]) -> None:
        spec = importlib.util.find_spec(module)
        if spec is None or spec.origin is None:
            raise LookupError(f"{module}: no such module")
        self.module, self.path, self._spec, self._tests = module, spec.origin, spec, tests
        self.source = Path(self.path).read_text(encoding="utf-8")
        self.known = mutants(self.source)

    def sampled(self, count: int | None, seed: int, grep: str = "") -> list[int]:
        """Numbers of so many mutants, all for None, in random order; only of lines with this text."""
        lines = self.source.splitlines()
        chosen = [number for number, one in enumerate(self.known) if grep in lines[one.line - 1]]
        random.Random(seed).shuffle(chosen)  # noqa: S311  # no secret
        return chosen[:count]

    def try_mutants(self, chosen: Sequence[int], seconds: float) -> tuple[int, list[Mutant]]:
        """Try mutants in this order for so long, and print those that survive; returns how many were tried, and these.

        AssertionError when the tests fail without a mutant.
        """
        left, tried, start_s = list[Mutant](), 0, time.monotonic()
        if not self.survives(-1, 0.0):
            raise AssertionError(f"{self.module}: the tests fail already without a mutant")
        patience_s = max(LEAST_PATIENCE_S, PATIENCE * (time.monotonic() - start_s))
        for number in chosen:
            if time.monotonic() - start_s > seconds:
                break
            tried += 1
            if self.survives(number, patience_s):
                one = self.known[number]
                left.append(one)
                print(f"{Path(self.path).name}:{one.line}: {one.before}  ->  {one.after}: {one.reads}", flush=True)
        return tried, left

    def survives(self, number: int, patience_s: float) -> bool:
        """Whether all tests pass in time (0: whenever) with the mutant of this number in the place of the module."""
        child = os.fork()
        if child == 0:
            good = False
            with contextlib.suppress(BaseException):
                signal.setitimer(signal.ITIMER_REAL, patience_s)
                good = self._pytest(number)
            os._exit(int(not good))
        return os.waitpid(child, 0)[1] == 0

    def _pytest(self, number: int) -> bool:
        silence = os.open(os.devnull, os.O_WRONLY)
        os.dup2(silence, 1)
        os.dup2(silence, 2)
        sys.modules[self.module] = module = importlib.util.module_from_spec(self._spec)
        exec(compile(mutated(self.source, number), self.path, "exec"), module.__dict__)  # noqa: S102  # our own code
        # The timer of faulthandler has no thread in a fork, and a test that fails would wait for it for ever.
        words = ["-xq", *WITHOUT, f"--hypothesis-profile={PROFILE}", *self._tests]
        return pytest.main(words) == pytest.ExitCode.OK


def prepare() -> None:
    """Load what is large before all forks; hypothesis reports a failing property without shrinking."""
    for name in ("numpy", "scipy.linalg", "rclpy"):
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
    hypothesis.settings.register_profile(PROFILE, deadline=None, derandomize=True, phases=phases)
