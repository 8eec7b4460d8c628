"""Builds the site: pages are prepared in a folder, then Zensical, in an environment of its own, makes HTML of them.

`./hindrax reference --site --out DIR` builds it; `python -m hindrax_tools.site.build` checks whether it can be.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import yaml

from hindrax_bringup.clone import clone_root
from hindrax_tools.site.notebook import notebook_page
from hindrax_tools.site.pages import (
    API,
    ELSEWHERE,
    Formula,
    api_page,
    formulas_of,
    navigation,
    relinked,
    slug,
    with_formulas,
)

NOTEBOOK = "docs/how-to/analyze-in-python.ipynb"
DRAW = """
import json, sys
from latex2mathml.converter import convert
print(json.dumps([convert(tex, display="block" if alone else "inline") for tex, alone in json.load(sys.stdin)]))
"""


def build(root: Path, out: Path, repository: str = "") -> int:
    """Build the site into a folder; returns the exit code of Zensical, which takes a warning for an error."""
    made = subprocess.run([root / "setup/site.sh"], stdout=subprocess.PIPE, text=True, check=False)  # noqa: S603  # our own
    if made.returncode:
        return made.returncode
    programs = Path(made.stdout.strip()) / "bin"
    with tempfile.TemporaryDirectory() as folder:
        prepare(root, Path(folder), programs, repository)
        words = [str(programs / "zensical"), "build", "--strict"]
        done = subprocess.run(words, cwd=folder, check=False, capture_output=True, text=True)  # noqa: S603  # our own
        if done.returncode:
            print(done.stdout, done.stderr)
        else:
            shutil.copytree(Path(folder, "site"), out, dirs_exist_ok=True)
        return done.returncode


def prepare(root: Path, folder: Path, programs: Path, repository: str) -> None:
    """Write pages and settings of Zensical into a folder."""
    docs = folder / "docs"
    shutil.copytree(root / "docs", docs, ignore=shutil.ignore_patterns("*.ipynb"))
    texts = {str(file.relative_to(root)): file.read_text(encoding="utf-8") for file in (root / "docs").rglob("*.md")}
    texts |= {name: (root / name).read_text(encoding="utf-8") for name in ("CONTRIBUTING.md", "CHANGELOG.md")}
    figures = docs / "how-to" / "figures"
    texts[NOTEBOOK] = notebook_page(root / NOTEBOOK, figures, root)
    drawn = _drawn(sorted({one for text in texts.values() for one in formulas_of(text)}), programs)
    for name, text in texts.items():
        page = relinked(with_formulas(text, drawn if formulas_of(text) else {}), name, repository)
        (docs / ELSEWHERE.get(name, name.removeprefix("docs/"))).write_text(page, encoding="utf-8")
    (docs / "api").mkdir()
    for title, modules in API.items():
        (docs / "api" / f"{slug(title)}.md").write_text(api_page(title, modules), encoding="utf-8")
    decisions = sorted(str(file.relative_to(docs)) for file in (docs / "adr").glob("*.md"))
    shutil.copy(Path(__file__).with_name("site.css"), docs)
    settings = yaml.safe_load(Path(__file__).with_name("mkdocs.yml").read_text(encoding="utf-8"))
    settings["nav"] = navigation(texts["docs/README.md"], decisions)
    paths = [str(one) for one in sorted((root / "src").glob("hindrax_*"))]
    settings["plugins"][-1]["mkdocstrings"]["handlers"]["python"]["paths"] = paths
    if repository:
        settings["repo_url"] = repository.partition("/blob/")[0]
    (folder / "mkdocs.yml").write_text(yaml.safe_dump(settings, sort_keys=False), encoding="utf-8")


def _drawn(formulas: Sequence[Formula], programs: Path) -> dict[Formula, str]:
    """MathML of each formula, which browsers draw without a script."""
    done = subprocess.run(  # noqa: S603  # our own
        [programs / "python", "-c", DRAW], input=json.dumps(formulas), stdout=subprocess.PIPE, text=True, check=True
    )
    # A line that begins with <math> would begin a block, and end the paragraph.
    spans = {one: '<span class="formula" tabindex="0">' if one[1] else "<span>" for one in formulas}
    return {one: f"{spans[one]}{drawn}</span>" for one, drawn in zip(formulas, json.loads(done.stdout), strict=True)}


def main() -> int:
    """Build the site of this clone where nobody looks at it: whether it can be built."""
    with tempfile.TemporaryDirectory() as folder:
        return build(clone_root(), Path(folder))


if __name__ == "__main__":
    sys.exit(main())
