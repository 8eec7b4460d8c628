"""The structure that `docs/architecture.md` claims; what import-linter checks stands in pyproject.toml."""

import ast
import configparser
import functools
import re
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from launch_stand_in import put_in_place

from hindrax_core.sensor_table import SENSORS

ROOT = Path(__file__).parents[2]
MOST_MODULES = 16
MOST_ANY = 94
"""Lines of the product; what is left stands at libraries without annotations, and at documents of JSON and YAML."""
MOST_CASTS = 10
LEAST_EXPLAINED = 0.2
"""Lines of the product that are comment or docstring, of those that are not empty [-]."""
PACKAGES = sorted(path.parent.name for path in ROOT.glob("src/*/package.xml"))
SOURCES = sorted(
    path
    for folder in ("src/hindrax_*/hindrax_*", "tools/hindrax_tools")
    for path in ROOT.glob(f"{folder}/**/*.py")
    if "firmware" not in path.parts
)
FOLDERS = Counter(path.parent for path in SOURCES if path.name != "__init__.py")
ROW = re.compile(r"^\| \[`src/(hindrax_\w+)`\]\(\S+\) \| (.*?) \| (\d+) \| .* \|$", re.MULTILINE)


@functools.cache
def syntax(source: Path) -> ast.Module:
    """Syntax tree of a file, parsed once for all tests."""
    return ast.parse(source.read_text(encoding="utf-8"))


def imports(source: Path) -> Iterator[str]:
    """Dotted names that a file imports from packages of ours."""
    for node in ast.walk(syntax(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hindrax_"):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.startswith("hindrax_"))


@functools.cache
def product() -> dict[str, tuple[str, ast.Module]]:
    """Text and syntax tree of each file that is installed, without helpers of tests."""
    return {
        str(source.relative_to(ROOT)): (source.read_text(encoding="utf-8"), syntax(source))
        for source in SOURCES
        if "src" in source.relative_to(ROOT).parts and "testing" not in source.parts
    }


def lines_with(found: Callable[[ast.AST], bool]) -> list[str]:
    """File and line of each node of the product that is meant, once a line."""
    nodes = ((name, node) for name, (_, tree) in product().items() for node in ast.walk(tree) if found(node))
    return list(dict.fromkeys(f"{name}:{getattr(node, 'lineno', 0)}" for name, node in nodes))


def is_named(node: ast.AST, name: str) -> bool:
    """Whether a node is this name, alone or of a module."""
    return (isinstance(node, ast.Name) and node.id == name) or (isinstance(node, ast.Attribute) and node.attr == name)


def test_any_does_not_creep_back() -> None:
    found = lines_with(lambda node: is_named(node, "Any"))
    assert len(found) <= MOST_ANY, f"{len(found)} lines with Any, wanted {MOST_ANY} at most; which type is it?"


def test_casts_do_not_creep_back() -> None:
    found = lines_with(lambda node: isinstance(node, ast.Call) and ast.unparse(node.func) in {"cast", "typing.cast"})
    assert len(found) <= MOST_CASTS, f"{found}, wanted {MOST_CASTS} casts at most; which type is it?"


def test_a_kind_of_sensor_is_named_by_its_row_and_its_own_modules_alone() -> None:
    kinds = {row.name for row in SENSORS if re.search(r"\d", row.name)}
    named = lines_with(lambda node: isinstance(node, ast.Constant) and node.value in kinds)
    elsewhere = [one for one in named if "/devices/" not in one and "/sensor_table.py:" not in one]
    assert not elsewhere, "ask for what it measures: Vehicle.measuring"


def test_text_is_run_only_where_the_plan_says_so() -> None:
    """`exec`, `eval`: hidden doors, each with its row on the page."""
    doors = {
        name
        for source in SOURCES
        for name in [str(source.relative_to(ROOT))]
        for node in ast.walk(syntax(source))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in {"exec", "eval"}
    }
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    assert doors <= set(re.findall(r"^\| `([^`]+\.py)` \|", page, re.MULTILINE))


def test_the_code_explains_itself() -> None:
    explained = written = 0
    for text, tree in product().values():
        lines = text.splitlines()
        of_text = {
            at
            for body in (getattr(node, "body", None) for node in ast.walk(tree))
            if isinstance(body, list)
            for one in body
            if isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant) and isinstance(one.value.value, str)
            for at in range(one.lineno - 1, one.end_lineno or one.lineno)
        }
        full = [at for at, line in enumerate(lines) if line.strip()]
        written += len(full)
        explained += sum(at in of_text or lines[at].lstrip().startswith("#") for at in full)
    assert explained > LEAST_EXPLAINED * written, f"{explained / written:.1%} of the lines say what for or why"


def test_a_file_that_the_plan_names_is_there() -> None:
    """Names of files on the page, whole or from a package or folder on, as its ways have them."""
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    there = [f"/{source.relative_to(ROOT)}" for source in SOURCES]
    named = set(re.findall(r"[\w/]*\w\.py\b", page)) - {"devices/NAME.py"}
    assert len(named) > 50
    assert not [name for name in sorted(named) if not any(one.endswith(f"/{name}") for one in there)]


def test_what_the_ways_name_in_a_file_is_defined_there() -> None:
    """Such as `maneuver/goal.py: require_flyable`: a function, a class or a table."""
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    named = re.findall(r"([\w/]*\w\.py): ([A-Za-z]+[A-Z_][A-Za-z_]*)\b", page)
    assert len(named) > 5
    for name, symbol in named:
        texts = [source.read_text(encoding="utf-8") for source in SOURCES if str(source).endswith(f"/{name}")]
        defined = re.compile(rf"^(?:class |def |){symbol}\b", re.MULTILINE)
        assert any(defined.search(text) for text in texts), f"{name}: {symbol}"


@pytest.mark.parametrize("folder", sorted(FOLDERS), ids=lambda folder: str(folder.relative_to(ROOT)))
def test_a_folder_fits_on_a_screen(folder: Path) -> None:
    assert FOLDERS[folder] <= MOST_MODULES, f"{folder}: {FOLDERS[folder]} modules; which theme wants its own folder?"


ARRAY = re.compile(r"\b(Array|Matrix|NDArray|ndarray)\b")
SHAPE = re.compile(r"\((\w|\.\.\.)[^()]*,[^()]*\)")


def where_shapes_stand(docstring: str) -> str:
    """The first line, or the section of what is returned where there is one."""
    first, _, rest = docstring.partition("\n")
    return rest.partition("Returns\n-------\n")[2].partition("\n\n")[0] or first


def test_a_function_that_returns_arrays_names_their_shapes_where_they_are_looked_for() -> None:
    found = [
        f"{source.relative_to(ROOT)}: {node.name}"
        for source in SOURCES
        for node in ast.walk(syntax(source))
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and node.returns is not None
        if ARRAY.search(ast.unparse(node.returns))
        if not SHAPE.search(where_shapes_stand(ast.get_docstring(node) or ""))
    ]
    assert not found


def shown_texts(source: Path) -> Iterator[str]:
    """Texts of a file that may be shown: all but its docstrings."""
    tree = syntax(source)
    unshown = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in unshown:
            yield node.value


def test_a_command_in_a_sentence_can_be_pasted() -> None:
    found = [
        f"{source.relative_to(ROOT)}: {text}"
        for source in SOURCES
        for text in shown_texts(source)
        if "`hindrax " in text
    ]
    assert not found, "wanted ./hindrax, as the help has it"


def test_no_package_imports_private_names_of_another() -> None:
    found = [
        f"{source.relative_to(ROOT)}: {name}"
        for source in SOURCES
        for name in imports(source)
        if re.search(r"\._(?!_)", name) and name.split(".")[0] not in source.parts
    ]
    assert not found


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_states_what_it_is_and_how_to_use_it_alone(package: str) -> None:
    readme = (ROOT / "src" / package / "README.md").read_text(encoding="utf-8")
    assert readme.startswith(f"# {package}\n")
    assert "**Needs**" in readme
    assert "**Use it alone**" in readme


@pytest.mark.parametrize("package", PACKAGES)
def test_python_examples_of_a_readme_import_what_there_is(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    put_in_place(monkeypatch)  # launch is not among the wheels
    readme = (ROOT / "src" / package / "README.md").read_text(encoding="utf-8")
    for block in re.findall(r"```python\n(.*?)```", readme, re.DOTALL):
        body = ast.parse(block).body
        statements: list[ast.stmt] = [one for one in body if isinstance(one, ast.Import | ast.ImportFrom)]
        exec(compile(ast.Module(statements, type_ignores=[]), package, "exec"), {})


def test_the_table_of_packages_is_true() -> None:
    rows = {
        name: (about, int(lines)) for name, about, lines in ROW.findall((ROOT / "docs/architecture.md").read_text())
    }
    assert sorted(rows) == PACKAGES
    for package, (about, lines) in rows.items():
        sources = [path for path in SOURCES if package in path.parts]
        setup = configparser.ConfigParser()
        if setup.read(ROOT / "src" / package / "setup.cfg"):
            assert about == setup["metadata"]["description"]
            counted = sum(len(path.read_text(encoding="utf-8").splitlines()) for path in sources)
            assert lines == pytest.approx(counted, rel=0.15, abs=150), (
                f"docs/architecture.md: {package} has {counted} lines"
            )
