"""Fields read in place by a definition: what lies where, and bytes of every other kind."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_core.messages.cdr import CdrLayout, CdrReader
from hindrax_core.messages.definition import ONE, SEPARATOR, SEQUENCE, Field, parsed

TEXT = f"""# comment, with a float64 word in it
uint8 LIMIT=3
Word[] words
float64[2] pair          # aligned to eight
string name
string<=5[<=3] notes
other_msgs/msg/Nothing nothing
bool last
{SEPARATOR}
MSG: demo_msgs/Word
uint8 number
string text
{SEPARATOR}
MSG: other_msgs/Nothing
"""
DEFINITION = parsed("demo_msgs/msg/Sample", TEXT)
HEAD = b"\0\1\0\0"


def sample(*words: tuple[int, bytes], name: bytes = b"name", notes: tuple[bytes, ...] = ()) -> bytes:
    """CDR as of XCDR1, little-endian, put together by hand: every string with its zero, every number aligned."""
    body = struct.pack("<I", len(words))
    for number, text in words:
        body += struct.pack("<B", number)
        body += string(len(body), text)
    body += bytes(-len(body) % 8) + struct.pack("<2d", 1.5, -2.5)
    body += string(len(body), name)
    body += bytes(-len(body) % 4) + struct.pack("<I", len(notes))
    for note in notes:
        body += string(len(body), note)
    return HEAD + body + b"\0" + b"\1"  # a message without fields is one byte


def string(at: int, text: bytes) -> bytes:
    return bytes(-at % 4) + struct.pack("<I", len(text) + 1) + text + b"\0"


def test_a_definition_by_its_text() -> None:
    assert DEFINITION["demo_msgs/Sample"] == (
        Field("words", "demo_msgs/Word", SEQUENCE),
        Field("pair", "float64", 2),
        Field("name", "string", ONE),
        Field("notes", "string", SEQUENCE),
        Field("nothing", "other_msgs/Nothing", ONE),
        Field("last", "bool", ONE),
    )
    assert DEFINITION["other_msgs/Nothing"] == ()


def test_fields_of_every_shape_are_read() -> None:
    read = CdrReader(DEFINITION, "pair", "name", "last").read
    for _ in range(2):  # the second time the shapes come back
        assert read(sample()) == (1.5, -2.5, "name", True)
        assert read(sample((7, b"one"), (8, b""), name="Wülfing".encode())) == (1.5, -2.5, "Wülfing", True)
        assert read(sample(name=b"", notes=(b"abc", b""))) == (1.5, -2.5, "", True)
    assert CdrReader(DEFINITION, "words.1.number", "words.1.text", "notes.0").read(
        sample((7, b"one"), (8, b"two"), notes=(b"abc",))
    ) == (8, "two", "abc")


def test_a_field_that_a_message_does_not_have_is_named() -> None:
    with pytest.raises(ValueError, match=r"no field 'words.0.number'"):
        CdrReader(DEFINITION, "words.0.number").read(sample())


@given(st.binary(max_size=80))
def test_no_bytes_do_more_than_be_refused(data: bytes) -> None:
    try:
        layout = CdrLayout(DEFINITION, HEAD + data)
    except ValueError:
        return
    assert layout.size <= len(HEAD + data)


@pytest.mark.parametrize("length", [2**32 - 1, 2**31, 1000])
@pytest.mark.parametrize("at", [4, 28])  # of the words, of the name
def test_no_length_in_the_bytes_is_trusted(length: int, at: int) -> None:
    data = bytearray(sample())
    data[at : at + 4] = struct.pack("<I", length)
    with pytest.raises(ValueError, match=r"found \d+ bytes, wanted \d+"):
        CdrLayout(DEFINITION, bytes(data))
