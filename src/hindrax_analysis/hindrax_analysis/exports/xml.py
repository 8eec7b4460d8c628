"""The little XML that three formats share."""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET


def number(value: float) -> str:
    """Shortest text with nine significant digits, and never -0."""
    return f"{value + 0.0:.9g}"


def add(parent: ET.Element, name: str, text: str) -> ET.Element:
    """Append a child element that holds a text."""
    child = ET.SubElement(parent, name)
    child.text = text
    return child


def commented(root: ET.Element, lines: Sequence[str]) -> str:
    """XML text with its declaration, and the lines as a comment in front."""
    ET.indent(root)
    # Two hyphens would end the comment early.
    body = "\n".join(f"  {line.replace('--', '- -')}" for line in lines)
    return f'<?xml version="1.0"?>\n<!--\n{body}\n-->\n{ET.tostring(root, encoding="unicode")}\n'
