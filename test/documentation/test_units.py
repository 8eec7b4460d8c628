"""Units on the screen and in the pages are written as SI has them: a space between the units of a product."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from documentation.pages import PAGES, ROOT

NO_PRODUCT = re.compile(r"\bNm\b")
"""Newton metre is N m (BIPM, SI brochure, 5.2); `_Nm` ends names of columns and keys, which stay."""
SUFFIX = "Nm"
"""The end of such a name, where code looks for it."""


def texts_of(code: str) -> Iterator[str]:
    """Strings of a module, docstrings too, and the constant parts of formatted ones."""
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value != SUFFIX:
            yield node.value


@pytest.mark.parametrize(
    "folder", sorted(path for path in (ROOT / "src").iterdir() if path.is_dir()), ids=lambda p: p.name
)
def test_no_text_of_a_package_joins_the_units_of_a_product(folder: Path) -> None:
    for module in folder.rglob("*.py"):
        code = module.read_text(encoding="utf-8")
        joined = [text for text in (texts_of(code) if NO_PRODUCT.search(code) else ()) if NO_PRODUCT.search(text)]
        assert not joined, f"{module.relative_to(ROOT)}: wanted N m"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_page_does(page: Path) -> None:
    assert not NO_PRODUCT.search(page.read_text(encoding="utf-8")), "wanted N m"


def test_what_is_joined_is_noticed() -> None:
    texts = list(texts_of('"[N, Nm]"; f"{3} Nm"; "force_Nm".endswith("Nm"); Nm = 1'))
    assert [bool(NO_PRODUCT.search(text)) for text in texts] == [True, True, False]
