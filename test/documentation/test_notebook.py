"""The notebook of the how-to runs from its first cell to its last, and says what is true."""

import ast
import json
import math
import sys
import tomllib
from pathlib import Path
from typing import Any

import matplotlib as mpl
import pytest

ROOT = Path(__file__).parents[2]
NOTEBOOK = json.loads((ROOT / "docs/how-to/analyze-in-python.ipynb").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def after() -> dict[str, Any]:
    """What is defined after the last cell."""
    found: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT / "docs/how-to")
        # As in a Jupyter that knows nothing of the clone but this folder.
        patch.delenv("HINDRAX_ROOT", raising=False)
        mpl.use("Agg")
        for number, cell in enumerate(NOTEBOOK["cells"]):
            if cell["cell_type"] == "code":
                exec(compile("".join(cell["source"]), f"cell {number}", "exec"), found)
    return found


def test_the_tables_are_those_of_pandas_and_xarray(after: dict[str, Any]) -> None:
    assert dict(after["dataset"].sizes) == {"time_s": len(after["rates"])}
    assert float(after["dataset"]["angular_velocity.y"].max()) == after["rates"]["angular_velocity.y"].max()
    assert len(after["thrust"]) > 100


def test_what_it_identifies_and_predicts_is_true(after: dict[str, Any]) -> None:
    table = after["coefficients"]
    assert ((table["value"] - table["truth"]).abs() < 4.0 * table["std"]).all()
    value = table.set_index("coefficient")["value"]
    # It comes to rest where the restoring moment balances what turns it.
    assert abs(after["rate"][-1]) < 0.01
    assert value["k_r"] * math.sin(after["angle"]) == pytest.approx(0.5 - value["b"], rel=0.05)


def test_it_is_a_notebook_without_outputs() -> None:
    assert (NOTEBOOK["nbformat"], NOTEBOOK["nbformat_minor"]) == (4, 5)
    assert len({cell["id"] for cell in NOTEBOOK["cells"]}) == len(NOTEBOOK["cells"])
    assert not any(cell.get("outputs") for cell in NOTEBOOK["cells"])


def test_the_extra_of_the_wheel_holds_what_the_notebook_imports() -> None:
    wheel = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    source = "\n".join("".join(cell["source"]) for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code")
    found = {alias.name for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Import) for alias in node.names}
    # pandas makes `to_xarray` a method, and imports xarray in it.
    wanted = found | ({"xarray"} if ".to_xarray()" in source else set())
    assert wanted - sys.stdlib_module_names - {"numpy"} <= set(wheel["notebook"])
