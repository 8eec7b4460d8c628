"""A notebook as a page, with the outputs of its cells; it is run here, without Jupyter."""

import ast
import json
import os
from collections.abc import Iterator
from pathlib import Path
from pprint import pformat

import matplotlib as mpl

MOST_LINES = 25
"""Of an output as text."""


def notebook_page(notebook: Path, figures: Path, root: Path) -> str:
    """Markdown of a notebook run from its first cell to its last; figures go to a folder beside the page."""
    mpl.use("Agg")
    os.environ["HINDRAX_ROOT"] = str(root)
    known: dict[str, object] = {"__name__": "__main__"}
    parts = []
    for number, cell in enumerate(json.loads(notebook.read_text(encoding="utf-8"))["cells"]):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
        else:
            parts += [f"```python\n{source}\n```", *_outputs(source, known, figures / f"cell-{number}.svg")]
    return "\n\n".join([*parts, ""])


def _outputs(source: str, known: dict[str, object], figure: Path) -> Iterator[str]:
    """Run a cell: the value of its last expression, and what it has drawn."""
    from matplotlib import pyplot as plt  # noqa: PLC0415  # after the choice of what draws

    body = ast.parse(source).body
    end = body[-1] if body else None
    last = ast.Expression(end.value) if isinstance(end, ast.Expr) else None
    exec(compile(ast.Module(body[:-1] if last else body, []), str(figure), "exec"), known)  # noqa: S102  # our own notebook
    value: object = eval(compile(last, str(figure), "eval"), known) if last else None  # noqa: S307  # the same
    if plt.get_fignums():
        figure.parent.mkdir(parents=True, exist_ok=True)
        plt.gcf().savefig(figure, bbox_inches="tight")
        plt.close("all")
        yield f"![Figure of the cell above]({figure.parent.name}/{figure.name})"
    elif value is not None and hasattr(value, "_repr_html_") and hasattr(value, "columns"):
        # The protocol of notebooks. A screen reader wants no empty head, and a keyboard a way into what scrolls.
        drawn = str(value._repr_html_()).replace("<th></th>", "<td></td>")
        yield drawn.replace('class="dataframe"', 'class="dataframe" tabindex="0"')
    elif value is not None:
        yield "```text\n{}\n```".format("\n".join(pformat(value, width=100).splitlines()[:MOST_LINES]))
