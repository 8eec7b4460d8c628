"""Tables and heads of the reference pages."""

from collections.abc import Iterable, Sequence


def head(title: str, about: str) -> str:
    """Title of a page, where it comes from, and what it is about."""
    return f"# {title}\n\n<!-- Written by `./hindrax reference --write` from the code; do not edit. -->\n\n{about}\n"


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """One table; bars and line ends inside cells are made harmless."""
    lines = [_row(columns), _row(["---"] * len(columns))]
    return "\n".join([*lines, *(_row(row) for row in rows)]) + "\n"


def code(text: str) -> str:
    """Text as code, nothing when there is none."""
    return f"`{text}`" if text else ""


def number(value: float) -> str:
    """A number without trailing zeros."""
    return f"{value:.10g}"


def _row(cells: Sequence[str]) -> str:
    return "| " + " | ".join(" ".join(cell.replace("|", "\\|").split()) for cell in cells) + " |"
