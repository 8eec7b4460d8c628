"""The site: links that leave the documentation, formulas, navigation. Whether it builds, `./hindrax test` checks."""

import importlib.util
import json
from pathlib import Path

import pytest
import yaml

from hindrax_bringup.clone import clone_root
from hindrax_tools.site.notebook import notebook_page
from hindrax_tools.site.pages import API, formulas_of, navigation, relinked, with_formulas

DOCS = clone_root() / "docs"


@pytest.mark.parametrize(
    ("link", "there"),
    [
        ("[a](../tutorial.md#b)", "[a](../tutorial.md#b)"),
        ("[a](../../README.md)", "[a](../README.md)"),
        ("[a](../../CONTRIBUTING.md)", "[a](../contributing.md)"),
        ("[a](analyze-in-python.ipynb)", "[a](analyze-in-python.md)"),
        ("[a](https://example.org)", "[a](https://example.org)"),
        ("[a](#b)", "[a](#b)"),
        ("[`a`](../../src/a.py)", "`a`"),
        ("```\n[a](../../src/a.py)\n```", "```\n[a](../../src/a.py)\n```"),
        ("![a](../../src/a.png)", "![a](../../src/a.png)"),
    ],
)
def test_a_link_leads_to_the_page_of_the_site_or_nowhere(link: str, there: str) -> None:
    assert relinked(f"see\n{link}\n.", "docs/how-to/x.md", "") == f"see\n{there}\n."


def test_a_link_to_a_file_leads_to_the_repository_where_there_is_one() -> None:
    found = relinked("[a](../src/a.py)", "docs/x.md", "https://forge.invalid/hindrax/blob/v1")
    assert found == "[a](https://forge.invalid/hindrax/blob/v1/src/a.py)"


def test_only_a_page_with_formulas_on_their_own_lines_has_formulas() -> None:
    assert formulas_of("costs $5 or $6") == []
    broken = "where $a\n+ b$ is, but $5\n\nand $6"
    assert formulas_of(f"$$c$$\n{broken}") == [("c", True), ("a\n+ b", False)], (
        "over the end of a line, not of a paragraph"
    )
    text = "$$a = b$$\n\nwhere $a$ is\n\n```\n$c$\n```\n"
    assert formulas_of(text) == [("a = b", True), ("a", False)]
    assert (
        with_formulas(text, {("a = b", True): "<A>", ("a", False): "<B>"}) == "<A>\n\nwhere <B> is\n\n```\n$c$\n```\n"
    )


def test_every_page_is_in_the_navigation() -> None:
    decisions = sorted(f"adr/{file.name}" for file in (DOCS / "adr").glob("*.md"))
    shown = json.dumps(navigation((DOCS / "README.md").read_text(encoding="utf-8"), decisions))
    for file in DOCS.rglob("*.md"):
        assert f'"{file.relative_to(DOCS)}"' in shown
    assert "how-to/analyze-in-python.md" in shown


def test_the_modules_of_the_library_exist() -> None:
    for modules in API.values():
        for name in modules:
            assert importlib.util.find_spec(name), name


def test_the_settings_are_yaml_whose_last_plugin_gets_the_paths() -> None:
    file = clone_root() / "tools/hindrax_tools/site/mkdocs.yml"
    assert "python" in yaml.safe_load(file.read_text(encoding="utf-8"))["plugins"][-1]["mkdocstrings"]["handlers"]


def test_a_notebook_becomes_a_page_with_its_outputs(tmp_path: Path) -> None:
    code = ["import math\nfrom matplotlib import pyplot as plt\nx = 2.0", "math.sqrt(x) > 1", "plt.plot([0, x])\nNone"]
    cells = [{"cell_type": "markdown", "source": ["# A title"]}]
    cells += [{"cell_type": "code", "source": [one]} for one in code]
    (tmp_path / "a.ipynb").write_text(json.dumps({"cells": cells}), encoding="utf-8")
    page = notebook_page(tmp_path / "a.ipynb", tmp_path / "figures", clone_root())
    assert page.startswith("# A title\n\n```python\nimport math")
    assert "```text\nTrue\n```" in page
    assert "![Figure of the cell above](figures/cell-3.svg)" in page
    assert (tmp_path / "figures/cell-3.svg").stat().st_size > 1000
