"""The picture of the README: lines of a real terminal, in their order, as an SVG that scrolls."""

import itertools
import sys
from pathlib import Path
from xml.etree import ElementTree as ET

from hindrax_tools.moving_picture import TALL, WIDE, Line, LINE_px, animated, recorded


def test_a_command_is_recorded_as_it_looks_in_a_terminal(tmp_path: Path) -> None:
    told = "import os; print('\\33[1mbold\\33[0m <b>'); print('\\u280b busy');"
    told += "print(os.get_terminal_size().columns, os.getcwd())"
    lines = recorded([sys.executable, "-c", told], tmp_path)
    assert [one.text for one in lines] == ["bold <b>", f"{WIDE} {tmp_path}"]
    assert all(before.at_s <= after.at_s for before, after in itertools.pairwise(lines))


def test_lines_come_in_their_order_and_the_last_is_in_sight() -> None:
    lines = [Line(float(number), f"line {number} <&>") for number in range(40)]
    picture = animated("./hindrax x", lines)
    texts = [one.text for one in ET.fromstring(picture).iter() if one.tag.endswith("text")]
    assert texts == ["$ ./hindrax x", *(one.text for one in lines)]
    assert f"100%{{transform:translateY({-LINE_px * (41 - TALL)}px)}}" in picture
