"""Not set is None: no value that a knob may have counts as "not given" and is replaced behind a user's back."""

import ast
import dataclasses
import importlib
import math
import pkgutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from hindrax_core.knobs import knob_of

ROOT = Path(__file__).parents[2]
PACKAGES = ("hindrax_core", "hindrax_control", "hindrax_drivers", "hindrax_ident", "hindrax_sim")
"""Where knobs are declared; `nodes` need ROS, and declare none."""
SOURCES = sorted(
    path
    for folder in ("src/hindrax_*/hindrax_*", "tools/hindrax_tools")
    for path in ROOT.glob(f"{folder}/**/*.py")
    if "firmware" not in path.parts
)


def modules() -> Iterator[str]:
    for name in PACKAGES:
        package = importlib.import_module(name)
        for found in pkgutil.walk_packages(package.__path__, f"{name}."):
            if ".nodes" not in found.name and not found.name.endswith((".testing", "__main__")):
                yield found.name


def zero_knobs() -> dict[str, str]:
    """Name of each knob that may be zero, and the class that declares it."""
    found: dict[str, str] = {}
    for module in map(importlib.import_module, modules()):
        for kind in vars(module).values():
            if not (isinstance(kind, type) and dataclasses.is_dataclass(kind) and kind.__module__ == module.__name__):
                continue
            for declared in dataclasses.fields(kind):
                knob = knob_of(declared)
                numbers = isinstance(declared.default, int | float) or declared.default in (None, dataclasses.MISSING)
                if knob.meaning and not knob.choices and numbers and knob.low <= 0.0 <= knob.high < math.inf:
                    found[declared.name] = f"{kind.__module__}.{kind.__qualname__}"
    return found


def asked_for_truth(tree: ast.AST) -> Iterator[ast.expr]:
    """Every expression whose truth decides something."""
    for node in ast.walk(tree):
        if isinstance(node, ast.BoolOp):
            yield from node.values[:-1]
        elif isinstance(node, ast.IfExp | ast.If | ast.While | ast.Assert):
            yield node.test
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            yield node.operand
        elif isinstance(node, ast.comprehension):
            yield from node.ifs


@pytest.fixture(scope="module")
def knobs() -> dict[str, str]:
    return zero_knobs()


def test_the_sweep_sees_knobs_and_their_ranges(knobs: dict[str, str]) -> None:
    assert knobs["lag_s"].startswith("hindrax_")
    assert len(knobs) > 50


def test_a_knob_that_is_zero_is_never_taken_for_one_that_is_not_set(knobs: dict[str, str]) -> None:
    found = [
        f"{source.relative_to(ROOT)}:{one.lineno}: {ast.unparse(one)} (a knob of {knobs[one.attr]})"
        for source in SOURCES
        for one in asked_for_truth(ast.parse(source.read_text(encoding="utf-8")))
        if isinstance(one, ast.Attribute) and one.attr in knobs
    ]
    assert not found, "\n".join(found)
