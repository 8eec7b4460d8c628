"""Single mutations of one module, each against named tests: what survives is a line that no test holds.

    python -m hindrax_tools.mutation hindrax_core.stamp_window src/hindrax_core/test/test_stamp_window.py

No file is changed: a process of its own imports the mutant in the place of the module. So only tests that call the
module in their own process can kill a mutant. One that survives may also change nothing: read it before you write a
test.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import importlib
import importlib.abc
import importlib.machinery
import importlib.util
import os
import random
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import CodeType

import hypothesis

SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.And: ast.Or, ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
DROPPED = (ast.Not, ast.USub)
DECLARES = "knob"
"""Declares a parameter: its default and limits stand in the reference pages, which a test compares with the code."""
PROFILE = "mutation"
"""Settings of hypothesis."""
LONGEST_S = 60
"""A mutant that keeps its tests busy for longer is killed, and counts as killed."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """A change of one node: where, and what it is there now and in the mutant."""

    line: int
    before: str
    after: str


class _Mutate(ast.NodeTransformer):
    """Changes the node of one number, counted in the order of the source; -1: none. Lists what it passes."""

    def __init__(self, wanted: int = -1) -> None:
        self._wanted, self.found = wanted, list[Mutant]()

    def visit(self, node: ast.AST) -> ast.AST:
        """Change this node if it is the one; then what is below it."""
        if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module) and ast.get_docstring(node):
            docstring, *node.body = node.body
            if isinstance(node, ast.FunctionDef):
                node.args = self.visit(node.args)  # type: ignore[assignment]  # arguments stay arguments
            node.body = [docstring, *self._all(node.body)]
            return node
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == DECLARES:
            return node
        if isinstance(node, ast.AnnAssign | ast.arg):  # annotations are no code
            if isinstance(node, ast.AnnAssign) and node.value is not None:
                node.value = self.visit(node.value)  # type: ignore[assignment]  # an expression stays one
            return node
        for other in _others(node):
            self.found.append(Mutant(getattr(node, "lineno", 0), ast.unparse(node), ast.unparse(other)))
            if len(self.found) - 1 == self._wanted:
                return other
        return self.generic_visit(node)

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
    mutate = _Mutate()
    mutate.visit(ast.parse(source))
    return mutate.found


def mutated(source: str, number: int) -> ast.Module:
    """The tree of the mutant of this number; the source's own for -1."""
    tree = _Mutate(number).visit(ast.parse(source))
    assert isinstance(tree, ast.Module)
    return ast.fix_missing_locations(tree)


class _Loader(importlib.machinery.SourceFileLoader):
    """Loads a mutant, never from a cache."""

    number = -1

    def get_code(self, _name: str) -> CodeType:
        """Code of the mutant."""
        code: CodeType = compile(mutated(Path(self.path).read_text(encoding="utf-8"), self.number), self.path, "exec")
        return code


class _Finder(importlib.abc.MetaPathFinder):
    """Finds one module as its mutant."""

    def __init__(self, module: str, path: str, number: int) -> None:
        self._module, self._loader = module, _Loader(module, path)
        self._loader.number = number

    def find_spec(self, fullname: str, _path: object = None, _target: object = None, /) -> ModuleSpec | None:
        """Spec of the mutant; None for every other module."""
        return importlib.util.spec_from_loader(fullname, self._loader) if fullname == self._module else None


def survives(module: str, path: str, number: int, tests: Sequence[str]) -> bool:
    """Whether all tests pass with a mutant, in a process of its own."""
    child = os.fork()
    if child == 0:
        code = 1
        with contextlib.suppress(BaseException):
            signal.alarm(LONGEST_S)
            silence = os.open(os.devnull, os.O_WRONLY)
            os.dup2(silence, 1)
            os.dup2(silence, 2)
            sys.meta_path.insert(0, _Finder(module, path, number))
            words = ["-x", "-q", "-p", "no:cacheprovider", f"--hypothesis-profile={PROFILE}", *tests]
            code = int(importlib.import_module("pytest").main(words))
        os._exit(code)
    return os.waitpid(child, 0)[1] == 0


def main(words: Sequence[str] | None = None) -> int:
    """Try the mutants, in random order, and print those that survive; 1 when any does."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("module", help="as it is imported")
    parser.add_argument("tests", nargs="+", help="files or names of tests, as pytest takes them")
    parser.add_argument("--seconds", type=float, default=600.0, help="time after which no further mutant is tried")
    parser.add_argument("--grep", default="", help="only mutants of source lines with this text")
    options = parser.parse_args(words)
    place = importlib.util.find_spec(options.module)
    if place is None or place.origin is None:
        parser.error(f"{options.module}: no such module")
    source = Path(place.origin).read_text(encoding="utf-8")
    lines, known = source.splitlines(), mutants(source)
    chosen = [number for number, one in enumerate(known) if options.grep in lines[one.line - 1]]
    for heavy in ("pytest", "numpy", "scipy.linalg"):  # once, not in every process
        importlib.import_module(heavy)
    # That it fails is enough: to find the smallest example takes many times as long.
    phases = (hypothesis.Phase.explicit, hypothesis.Phase.generate)
    hypothesis.settings.register_profile(PROFILE, deadline=None, derandomize=True, phases=phases)
    if not survives(options.module, place.origin, -1, options.tests):
        parser.error("the tests fail already without a mutant")
    random.Random(1).shuffle(chosen)  # noqa: S311  # no secret
    end_s, left = time.monotonic() + options.seconds, list[Mutant]()
    tried = 0
    for number in chosen:
        if time.monotonic() > end_s:
            break
        tried += 1
        if survives(options.module, place.origin, number, options.tests):
            one = known[number]
            left.append(one)
            print(f"{place.origin}:{one.line}: {one.before}  ->  {one.after}", flush=True)
    print(f"{options.module}: {tried - len(left)} of {tried} mutants killed; {len(chosen) - tried} not tried")
    return int(bool(left))


if __name__ == "__main__":
    sys.exit(main())
