"""The structure that `docs/architecture.md` claims; what import-linter checks stands in pyproject.toml."""

import ast
import configparser
import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from launch_stand_in import put_in_place

ROOT = Path(__file__).parents[2]
MOST_MODULES = 16
MOST_ANY = 97
"""Lines of the product; what is left stands at libraries without annotations, and at documents of JSON and YAML."""
PACKAGES = sorted(path.parent.name for path in ROOT.glob("src/*/package.xml"))
SOURCES = sorted(
    path
    for folder in ("src/hindrax_*/hindrax_*", "tools/hindrax_tools")
    for path in ROOT.glob(f"{folder}/**/*.py")
    if "firmware" not in path.parts
)
FOLDERS = Counter(path.parent for path in SOURCES if path.name != "__init__.py")
ROW = re.compile(r"^\| \[`src/(hindrax_\w+)`\]\(\S+\) \| (.*?) \| (\d+) \| .* \|$", re.MULTILINE)


def imports(source: Path) -> Iterator[str]:
    """Dotted names that a file imports from packages of ours."""
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("hindrax_"):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.startswith("hindrax_"))


def test_any_does_not_creep_back() -> None:
    found = [
        f"{source.relative_to(ROOT)}:{line}"
        for source in SOURCES
        if "src" in source.relative_to(ROOT).parts and "testing" not in source.parts
        for line in {
            node.lineno
            for node in ast.walk(ast.parse(source.read_text(encoding="utf-8")))
            if (isinstance(node, ast.Name) and node.id == "Any")
            or (isinstance(node, ast.Attribute) and node.attr == "Any")
        }
    ]
    assert len(found) <= MOST_ANY, f"{len(found)} lines with Any, wanted {MOST_ANY} at most; which type is it?"


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
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and node.returns is not None
        if ARRAY.search(ast.unparse(node.returns))
        if not SHAPE.search(where_shapes_stand(ast.get_docstring(node) or ""))
    ]
    assert not found


def shown_texts(source: Path) -> Iterator[str]:
    """Texts of a file that may be shown: all but its docstrings."""
    tree = ast.parse(source.read_text(encoding="utf-8"))
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
