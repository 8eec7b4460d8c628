"""A self-contained page of HTML: no network, no script, no font."""

import math
import re
from collections.abc import Sequence
from html import escape
from pathlib import Path

from hindrax_core.text.digits import last_place
from hindrax_core.text.screen_text import as_called
from hindrax_ident.assess.results import Number

CSS = Path(__file__).with_name("style.css").read_text(encoding="utf-8")
EMPTY = "data:,"
"""An empty icon: without one, a browser requests it from the server."""


def page(title: str, body: str) -> str:
    """Whole document around a body."""
    return as_called(
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<link rel="icon" href="{EMPTY}">\n<title>{escape(title)}</title>\n<style>{CSS}</style>\n</head>\n'
        f"<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )


def prose(sentence: str) -> str:
    """A sentence as HTML, with commands in backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(sentence))


def bullets(sentences: Sequence[str]) -> str:
    """An unordered list of sentences."""
    return f"<ul>{''.join(f'<li>{prose(one)}</li>' for one in sentences)}</ul>"


def chips(texts: Sequence[tuple[str, ...]]) -> str:
    """Small labels: text and kind (good, bad, mock or nothing), and the id of the heading that it leads to, if any."""
    labels = []
    for text, kind, *target in texts:
        tag, link = ("a", f' href="#{target[0]}"') if target else ("span", "")
        labels.append(f'<{tag} class="{f"chip {kind}".strip()}"{link}>{escape(text)}</{tag}>')
    return f'<div class="chips">{"".join(labels)}</div>'


def table(
    headings: Sequence[str], rows: Sequence[Sequence[str]], own: Sequence[int] = (), words: Sequence[int] = (0,)
) -> str:
    """Table of cells that are HTML already. A phone shows each row as a card, every number under its heading.

    Parameters
    ----------
    headings, rows
        Cells.
    own
        Rows that stand out.
    words
        Columns that begin at the left.

    Returns
    -------
    str
        HTML.
    """
    sides = [' class="left"' if column in words else "" for column in range(len(headings))]
    head = "".join(f"<th{side}>{heading}</th>" for side, heading in zip(sides, headings, strict=True))
    again = ["", *(f'<span class="head">{heading}</span>' for heading in headings[1:])]
    lines = []
    for index, row in enumerate(rows):
        mark = ' class="own"' if index in own else ""
        named = [one + cell if cell else "" for one, cell in zip(again, row, strict=True)]
        cells = "".join(f"<td{side}>{cell}</td>" for side, cell in zip(sides, named, strict=True))
        lines.append(f"<tr{mark}>{cells}</tr>")
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{"".join(lines)}</tbody></table></div>'


def definitions(pairs: Sequence[tuple[str, str]]) -> str:
    """Definition list of name and text; pairs without a text are omitted."""
    return f"<dl>{''.join(f'<dt>{escape(name)}</dt><dd>{escape(text)}</dd>' for name, text in pairs if text)}</dl>"


def quoted(found: Number) -> str:
    """A coefficient as it is quoted, and below it what the record alone gives: 61.2 ± 1.4, fit 66.7 ± 0.22."""
    if found.corrected is None or not math.isfinite(found.std):
        return plus_minus(found.value, found.std, found.std_calibrated)
    return f"{plus_minus(*found.quoted)} <small>fit {plus_minus(found.value, found.std)}</small>"


def plus_minus(value: float, std: float, std_calibrated: float = math.nan) -> str:
    """Value with the deviation to quote, and below it the noise: 66.7 ± 1.4, ± 0.22.

    Parameters
    ----------
    value, std
        Of the fit.
    std_calibrated
        With all influences; NaN: not known, and then `std` is quoted.

    Returns
    -------
    str
        HTML, rounded to the second digit of the deviation.
    """
    quoted = std_calibrated if math.isfinite(std_calibrated) else std
    digits = decimals(value, quoted)
    if not math.isfinite(quoted):
        return number(value, digits)
    text = f"{number(value, digits)} \u00b1 {number(quoted, digits)}"
    if quoted is not std and math.isfinite(std):
        text += f" <small>noise \u00b1 {number(std, decimals(value, std))}</small>"
    return text


def decimals(value: float, std: float) -> int:
    """Digits behind the point: two of the deviation; three in all where there is none."""
    scale, digits = (std, 2) if math.isfinite(std) and std > 0.0 else (abs(value), 3)
    return min(6, max(0, -last_place(scale, digits))) if 0.0 < scale < math.inf else 2


def two_digits(value: float) -> str:
    """A number without a deviation, such as a deviation itself."""
    return number(value, decimals(math.nan, value))


def number(value: float, digits: int) -> str:
    """A number with a true minus sign, never a negative zero."""
    return f"{value:z.{digits}f}".replace("-", "\u2212")
