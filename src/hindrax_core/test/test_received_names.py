"""What another machine or a bag calls its files leads nowhere but below the folder that was asked for."""

import string
from pathlib import PurePosixPath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_core.text.received_names import file_name, path_fault


@pytest.mark.parametrize(
    ("name", "fault"),
    [
        ("bag/bag_0.mcap", ""),
        ("2026-01-31 14:00/a[b] é.mcap", ""),
        ("...", ""),
        ("-rf", ""),
        ("", "is not relative"),
        ("/etc/passwd", "is not relative"),
        ("../x", "leads out of the folder"),
        ("a/../../x", "leads out of the folder"),
        ("a/./x", "leads out of the folder"),
        ("a//x", "leads out of the folder"),
        ("a/", "leads out of the folder"),
        ("a\n12 /etc/passwd", "contains a control character"),
        ("a\x1b[2Jb", "contains a control character"),
        ("a\u202etxt", "contains a control character"),
        ("a\udc80b", "contains a control character"),
        ("a\0b", "contains a control character"),
    ],
)
def test_names_that_are_refused(name: str, fault: str) -> None:
    assert path_fault(name) == fault


@given(st.text(alphabet="ab./-\n\0 \x7f", max_size=12))
def test_what_is_taken_stays_below_its_folder(name: str) -> None:
    if not path_fault(name):
        path = PurePosixPath("/out") / name
        assert path.is_relative_to("/out")
        assert ".." not in path.parts
        assert path != PurePosixPath("/out")


@given(st.text(max_size=20))
def test_a_text_becomes_the_name_of_one_file(text: str) -> None:
    name = file_name(text)
    assert name not in ("", ".", "..")
    assert "/" not in name
    assert not path_fault(name) or set(name) - set(string.printable)


def test_a_topic_keeps_its_name() -> None:
    assert file_name("/hindrax/dvl75/velocity") == "hindrax_dvl75_velocity"
    assert file_name("/../../etc") == "_.._etc"
