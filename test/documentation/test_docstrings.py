"""What the library promises to its users is said in sections that tools parse: the site's pages and whole packages.

One line is enough where it says all: up to two parameters, and errors that it names. Functions of one form, as the
faults and conditions of tables, have their parameters in the docstring of their module; a command's docstring is its
help, for the terminal. Ruff checks the form of the sections (convention numpy), and that a section of parameters names
them all.
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
    *("hindrax_ros", "hindrax_drivers", "hindrax_replay", "hindrax_bringup", "hindrax_sim", "hindrax_i2c_file"),
    *("hindrax_operator", "hindrax_cli"),
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
    """Public functions and methods; a property is described as what it is, a command to whoever types it."""
    wrapped = {name for node in ast.walk(scope) if isinstance(node, ast.Call) for name in _made_a_command(node)}
    for node in scope.body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from _promised(node)
        elif isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and node.name not in wrapped:
            decorators = [ast.unparse(one) for one in node.decorator_list]
            if not any(re.search(r"property|setter|overload|^command\(", one) for one in decorators):
                yield node


def _made_a_command(call: ast.Call) -> list[str]:
    """Functions that `command(...)(function)` makes commands."""
    made = isinstance(call.func, ast.Call) and ast.unparse(call.func.func) == "command"
    return [one.id for one in call.args if isinstance(one, ast.Name)] if made else []


def _parameters(function: ast.FunctionDef) -> int:
    arguments = function.args
    named = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    return sum(one.arg not in {"self", "cls"} for one in named) + bool(arguments.vararg) + bool(arguments.kwarg)


def _errors(function: ast.FunctionDef) -> set[str]:
    raised = (node.exc for node in ast.walk(function) if isinstance(node, ast.Raise) and node.exc)
    names = {ast.unparse(one.func if isinstance(one, ast.Call) else one) for one in raised}
    return {one for one in names if one[0].isupper()}  # what else is raised is made elsewhere, or is passed on


def _names(function: ast.FunctionDef) -> set[str]:
    arguments = function.args
    named = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg, arguments.kwarg]
    return {one.arg.removeprefix("_") for one in named if one is not None} - {"self", "cls"}


def _shared(module: ast.Module) -> tuple[set[str], set[str]]:
    """Sections in the docstring of a module, and the parameters that it describes for all its functions."""
    parts = SECTION.split(ast.get_docstring(module) or "")
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    lines = re.findall(r"^\S.*$", sections.get("Parameters", ""), re.MULTILINE)
    return set(sections), {name.strip() for line in lines for name in line.partition(" : ")[0].split(",")}


def _lacking(function: ast.FunctionDef, shared: tuple[set[str], set[str]] = (set(), set())) -> list[str]:
    """What the docstring of a function does not say, nor that of its module."""
    text = ast.get_docstring(function) or ""
    errors = [name for name in sorted(_errors(function)) if not re.search(rf"\b{name}\b", text)]
    above, known = shared
    told = bool(_names(function)) and _names(function) <= known
    if "\n" not in text and text and (told or _parameters(function) <= MOST_IN_ONE_LINE):
        return errors
    sections = set(SECTION.findall(text)) | (above if told else set())
    generator = any(isinstance(node, ast.Yield | ast.YieldFrom) for node in ast.walk(function))
    given = "Yields" if generator else "Returns"
    nothing = function.returns is None or ast.unparse(function.returns) == "None"
    wanted = {"Parameters"} if _parameters(function) else set()
    wanted |= set() if nothing else {given}
    wanted |= {"Raises"} if _errors(function) else set()
    return sorted(wanted - sections) + errors


@pytest.mark.parametrize("module", MODULES)
def test_what_the_library_promises_has_its_sections(module: str) -> None:
    parsed = ast.parse(_text(module))
    lacking = {one.name: found for one in _promised(parsed) if (found := _lacking(one, _shared(parsed)))}
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


ABOVE = '''"""Faults of one form.

Parameters
----------
world, target
    Changed; and which thruster.
on : [-]
    Whether it begins.
"""
def f(world: W, target: str, _on: bool) -> None:
    """Begin or end it.

    More.
    """
def g(world: W, _target: str, gain: float) -> None:
    """Scale it."""
'''


def test_parameters_of_functions_of_one_form_are_said_once() -> None:
    parsed = ast.parse(ABOVE)
    assert {one.name: _lacking(one, _shared(parsed)) for one in _promised(parsed)} == {"f": [], "g": ["Parameters"]}


def test_a_command_has_the_docstring_that_its_help_shows() -> None:
    function = 'def fly(arguments: Namespace) -> int:\n    """Fly.\n\n    More.\n    """\n'
    for code in (f'@command("fly", about)\n{function}', f'{function}WORDS = {{"fly": command("fly")(fly)}}'):
        assert not list(_promised(ast.parse(code)))
    assert list(_promised(ast.parse(function)))
