"""The generated decoders, held against mcap's own decoder on messages of random schemas and values."""

from __future__ import annotations

import struct
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_ros2._dynamic import generate_dynamic, serialize_dynamic

from hindrax_bag import cdr
from hindrax_bag.compare import flat

NUMBERS = {
    "bool": st.booleans(),
    "uint8": st.integers(0, 255),
    "int16": st.integers(-(2**15), 2**15 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "int64": st.integers(-(2**63), 2**63 - 1),
    "float32": st.floats(width=32, allow_nan=False),
    "float64": st.floats(allow_nan=False),
    "string": st.text("abc \u00e4", max_size=9),
}
INNER = "uint8 flag\nfloat64 level\nstring name\n"
INNERS = st.builds(
    lambda flag, level, name: SimpleNamespace(flag=flag, level=level, name=name),
    NUMBERS["uint8"],
    NUMBERS["float64"],
    NUMBERS["string"],
)


@st.composite
def messages(draw):
    """A schema of up to eight fields, and a message of it."""
    lines, values = [], {}
    for index in range(draw(st.integers(1, 8))):
        kind = draw(st.sampled_from([*NUMBERS, "Inner"]))
        shape = draw(st.sampled_from(["", "[]", "[3]", "[<=5]", "[11]"]))
        one = NUMBERS.get(kind, INNERS)
        low, high = {"": (1, 1), "[3]": (3, 3), "[11]": (11, 11)}.get(shape, (0, 5))
        several = draw(st.lists(one, min_size=low, max_size=high))
        lines.append(f"{kind}{shape} f{index}  # {shape} of {kind}")
        values[f"f{index}"] = several if shape else several[0]
    text = "\n".join(["uint8 LIMIT=7", *lines]) + f"\n{'=' * 80}\nMSG: demo_msgs/Inner\n{INNER}"
    return text, SimpleNamespace(**values)


@settings(max_examples=150, deadline=None)
@given(messages())
def test_what_mcap_decodes_is_decoded_the_same(case):
    text, message = case
    plain = {name: bytes(value) if _octets(text, name) else value for name, value in vars(message).items()}
    data = serialize_dynamic("demo_msgs/msg/Any", text)["demo_msgs/msg/Any"](SimpleNamespace(**plain))
    expected = generate_dynamic("demo_msgs/msg/Any", text)["demo_msgs/msg/Any"](data)
    found = cdr.decoder("demo_msgs/msg/Any", text)(data)
    assert dict(flat(found)) == dict(flat(expected))
    match = cdr.matcher("demo_msgs/msg/Any", text)
    assert match(data, found)
    if len(data) > 5:
        with pytest.raises((ValueError, struct.error)):
            cdr.decoder("demo_msgs/msg/Any", text)(data[:4])


def _octets(text: str, name: str) -> bool:
    return any(
        line.split()[:2][-1] == name and line.startswith("uint8[") for line in text.splitlines() if line[:1] != "="
    )


LEVEL = "float32 level\nint32 count\nfloat64[3] xyz\nstring[] names\n"


def level(**changed):
    return SimpleNamespace(**{"level": 0.1, "count": -3, "xyz": [1.0, 2.0, 3.0], "names": ["a", "bc"], **changed})


@pytest.mark.parametrize(
    "changed",
    [{"level": 0.11}, {"count": 3}, {"xyz": [1.0, 2.0, 3.5]}, {"names": ["a"]}, {"names": ["a", "bd"]}, {"count": 4}],
)
def test_a_matcher_sees_every_field(changed):
    data = serialize_dynamic("demo_msgs/msg/Level", LEVEL)["demo_msgs/msg/Level"](level())
    match = cdr.matcher("demo_msgs/msg/Level", LEVEL)
    assert match(data, level())
    assert not match(data, level(**changed))


def test_nan_asks_for_a_closer_look():
    data = serialize_dynamic("demo_msgs/msg/Level", LEVEL)["demo_msgs/msg/Level"](level(level=float("nan")))
    assert not cdr.matcher("demo_msgs/msg/Level", LEVEL)(data, level(level=float("nan")))


def test_names_of_a_schema_cannot_become_code():
    decode = cdr.decoder("demo_msgs/msg/X", "uint8 class\nuint8 import\n")
    assert decode(b"\x00\x01\x00\x00\x01\x02").class_ == 1
    with pytest.raises(cdr.SchemaError, match="definition is missing"):
        cdr.decoder("demo_msgs/msg/X", "Unknown thing\n")
    with pytest.raises(cdr.SchemaError):
        cdr.decoder("demo_msgs/msg/X", "wstring text\n")
    assert cdr.decoder("x;print(1)/msg/y", "uint8 ok\n")(b"\x00\x01\x00\x00\x05").ok == 5


def test_a_message_that_ends_early_is_an_error():
    decode = cdr.decoder("demo_msgs/msg/Word", "string text\n")
    with pytest.raises(ValueError, match="found 9 bytes, wanted"):
        decode(b"\x00\x01\x00\x00\x0a\x00\x00\x00a")
