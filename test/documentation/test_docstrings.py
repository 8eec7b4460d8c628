"""What the library promises to its users is said in sections that tools parse: the site's pages and whole packages.

One line is enough where it says all: up to two parameters, and errors that it names. Ruff checks the form of the
sections (convention numpy), and that a section of parameters names them all.
"""

import ast
import importlib.util
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from hindrax_tools.site.pages import API

ROOT = Path(__file__).parents[2]
WHOLE = (
    *("hindrax_core", "hindrax_bag", "hindrax_ident", "hindrax_control", "hindrax_analysis", "hindrax_laboratory"),
    *("hindrax_ros", "hindrax_drivers", "hindrax_replay"),
)
"""Packages of which every module is held, but for nodes and helpers of tests."""


def _modules() -> set[str]:
    """Dotted names."""
    shown = {module for modules in API.values() for module in modules}
    paths = (path.relative_to(ROOT / "src" / one) for one in WHOLE for path in (ROOT / "src" / one / one).rglob("*.py"))
    of_whole = {path.with_suffix("").parts for path in paths if path.name != "__init__.py"}
    return shown | {".".join(parts) for parts in of_whole if not {"nodes", "testing"} & set(parts)}


MODULES = sorted(_modules())
SECTION = re.compile(r"^(Parameters|Returns|Yields|Raises)\n-+$", re.MULTILINE)
MOST_IN_ONE_LINE = 2


def _text(module: str) -> str:
    spec = importlib.util.find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).read_text(encoding="utf-8")


def _promised(scope: ast.Module | ast.ClassDef) -> Iterator[ast.FunctionDef]:
    """Public functions and methods; a property is described as what it is."""
    for node in scope.body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from _promised(node)
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            decorators = " ".join(ast.unparse(one) for one in node.decorator_list)
            if not re.search(r"property|overload", decorators):
                yield node


def _parameters(function: ast.FunctionDef) -> int:
    arguments = function.args
    named = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    return sum(one.arg not in {"self", "cls"} for one in named) + bool(arguments.vararg) + bool(arguments.kwarg)


def _errors(function: ast.FunctionDef) -> set[str]:
    raised = (node.exc for node in ast.walk(function) if isinstance(node, ast.Raise) and node.exc)
    names = {ast.unparse(one.func if isinstance(one, ast.Call) else one) for one in raised}
    return {one for one in names if one[0].isupper()}  # what else is raised is made elsewhere, or is passed on


def _lacking(function: ast.FunctionDef) -> list[str]:
    """What the docstring of a function does not say."""
    text = ast.get_docstring(function) or ""
    errors = [name for name in sorted(_errors(function)) if not re.search(rf"\b{name}\b", text)]
    if "\n" not in text and text and _parameters(function) <= MOST_IN_ONE_LINE:
        return errors
    sections = set(SECTION.findall(text))
    generator = any(isinstance(node, ast.Yield | ast.YieldFrom) for node in ast.walk(function))
    given = "Yields" if generator else "Returns"
    nothing = function.returns is None or ast.unparse(function.returns) == "None"
    wanted = {"Parameters"} if _parameters(function) else set()
    wanted |= set() if nothing else {given}
    wanted |= {"Raises"} if _errors(function) else set()
    return sorted(wanted - sections) + errors


@pytest.mark.parametrize("module", MODULES)
def test_what_the_library_promises_has_its_sections(module: str) -> None:
    lacking = {one.name: found for one in _promised(ast.parse(_text(module))) if (found := _lacking(one))}
    assert not lacking


@pytest.mark.parametrize(
    ("code", "lacking"),
    [
        ('def f(a: int) -> int:\n    """Half of it."""\n    return a', []),
        ('def f(a: int, b: int, c: int) -> int:\n    """Sum."""\n    return a', ["Parameters", "Returns"]),
        ('def f(a: int) -> None:\n    """Check.\n\n    More.\n    """', ["Parameters"]),
        ('def f(a: int) -> None:\n    """Check it."""\n    raise ValueError', ["ValueError"]),
        ('def f() -> Iterator[int]:\n    """Count.\n\n    More.\n    """\n    yield 1', ["Yields"]),
        ("def f() -> int:\n    return 1", ["Returns"]),
    ],
)
def test_what_a_docstring_does_not_say_is_found(code: str, lacking: list[str]) -> None:
    (function,) = _promised(ast.parse(code))
    assert _lacking(function) == lacking
