"""YAML from anybody is plain data or one sentence."""

import pytest
import yaml

from hindrax_core.errors import UsageError
from hindrax_core.text.yaml_text import ALIASES, DEPTH, DIGITS, NODES, read_yaml

MULTIPLIED = "a0: &a0 [1, 1, 1]\n" + "".join(f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]\n" for i in range(1, 13))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: " + "[" * 10_000 + "]" * 10_000, f"more than {DEPTH} nested blocks, line 1"),
        ("a: " + "{b: " * 10_000 + "}" * 10_000, f"more than {DEPTH} nested blocks"),
        ("a: [" * 10_000, f"more than {DEPTH} nested blocks"),
        (f"a: {'9' * 5000}", f"a number of 5000 characters, line 1; wanted at most {DIGITS}"),
        (f"a: 1.{'9' * 5000}", "a number of 5002 characters"),
        (f"a: 0x{'f' * 5000}", "a number of 5002 characters"),
        ("a: [" + "0," * NODES + "]", f"more than {NODES} values"),
        (MULTIPLIED, f"more than {ALIASES} repeated blocks"),
        ("a: 1\nb: 2\na: 3\n", "the key a again, first line 1, line 3; wanted each key once"),
        ("x:\n  a: 1\n  a: 1\n", "the key a again"),
        ("mass_kg: 1:30:00", "1:30:00, which YAML reads to the base 60, line 1; wanted a decimal number"),
        ("mass_kg: 1:30.5", "which YAML reads to the base 60"),
        ("a: [1", "x.yaml: is not YAML"),
        ("a: \x00", "x.yaml: is not YAML"),
        ("a: !!python/object/apply:os.system ['true']", "x.yaml: is not YAML"),
        ("a: &a [*a]\nb: *c", "x.yaml: is not YAML"),
    ],
)
def test_refused_in_one_sentence(text: str, words: str) -> None:
    with pytest.raises(UsageError) as raised:
        read_yaml(text, "x.yaml")
    assert words in str(raised.value)
    assert "\n" not in str(raised.value)
    assert len(str(raised.value)) < 400


def test_a_parser_with_a_bound_of_its_own_is_told_by_the_same_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    """libyaml of PyYAML 6.0.4, of which the one here may be older: it ends at 1000 before we have counted to 40."""
    mark = yaml.Mark("x.yaml", 1002, 6, 1002, None, 0)

    def parse(*_: object) -> None:
        raise yaml.scanner.ScannerError("while increasing flow level", mark, "exceeded maximum nesting depth", mark)

    monkeypatch.setattr(yaml, "parse", parse)
    with pytest.raises(UsageError, match=f"x.yaml: found more than {DEPTH} nested blocks, line 7; wanted fewer"):
        read_yaml("a: 1", "x.yaml")


@pytest.mark.parametrize(
    ("text", "data"),
    [
        ("", None),
        ("a: &p {x: 1}\nb: *p\nc: {<<: *p, y: 2}", {"a": {"x": 1}, "b": {"x": 1}, "c": {"x": 1, "y": 2}}),
        (
            "a: -1\nb: 1.5e-3\nc: .inf\nd: 0x10\ne: '1:30'",
            {"a": -1, "b": 0.0015, "c": float("inf"), "d": 16, "e": "1:30"},
        ),
        (
            "q: &q {x: 1}\np: &p {<<: *q, x: 2}\nr: {<<: *p, x: 3}",
            {"q": {"x": 1}, "p": {"x": 2}, "r": {"x": 3}},
        ),
    ],
)
def test_plain_data_is_read_as_ever(text: str, data: object) -> None:
    assert read_yaml(text, "x.yaml") == data
