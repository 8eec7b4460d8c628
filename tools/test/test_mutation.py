"""The tool that mutates a module changes what a test holds, and tells which test does not."""

import ast
import importlib.util
import sys
from pathlib import Path

import pytest

from hindrax_tools import mutation, mutation_table

SOURCE = '''"""Text with 3 and > in it."""

def limited(value: int = 3, top: int = 10) -> int:
    """Not `and`, nor 7."""
    return top if value > top and not value < 0 else -value

pairs = list(zip("ab", "cd", strict=True))
silence_s: float = knob(8.0, 0.0, 9.0, "a parameter, which the reference pages hold")
'''


def test_every_mutant_differs_from_its_source_and_leaves_texts_alone() -> None:
    same = compile(mutation.mutated(SOURCE, -1), "same", "exec")
    assert same.co_consts == compile(SOURCE, "source", "exec").co_consts
    known = mutation.mutants(SOURCE)
    changed = {(one.before, one.after) for one in known}
    assert {("value > top", "value <= top"), ("not value < 0", "value < 0"), ("-value", "value"), ("3", "4")} <= changed
    assert not [one for one in known if one.before in ("8.0", "9.0", "True")]
    trees = {ast.unparse(mutation.mutated(SOURCE, number)) for number in range(len(known))}
    assert len(trees) == len(known)
    assert all("Text with 3 and > in it." in one and "Not `and`, nor 7." in one for one in trees)


def test_it_shows_the_mutant_that_no_test_holds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "doubling.py").write_text("def twice(x):\n    return x * 2\n\n\ndef half(x):\n    return x / 2\n")
    tests = tmp_path / "test_doubling.py"
    tests.write_text("import doubling\n\n\ndef test_twice():\n    assert doubling.twice(3) == 6\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    assert mutation_table.main(["doubling", str(tests), "--grep", "x * 2"]) == 0
    assert "| doubling | 4 | 2 | 2 | 2 | 100 % |" in capsys.readouterr().out
    assert mutation_table.main(["doubling", str(tests), "--grep", "x / 2"]) == 1
    assert "x / 2  ->  x * 2" in capsys.readouterr().out


def test_a_module_is_named_with_its_tests(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        mutation_table.main(["doubling"])
    assert ended.value.code == 2
    assert "doubling: found no tests, wanted files or names of tests" in capsys.readouterr().err


def test_a_table_counts_what_changes_something_and_names_what_is_listed_in_vain(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "halving.py").write_text("def half(x): return x / 2\ndef twice(x): return x * 2 + 0 * x\n")
    tests = tmp_path / "test_halving.py"
    tests.write_text("import halving\n\n\ndef test_twice():\n    assert halving.twice(3.0) == 6.0\n")
    listed = tmp_path / "list.yaml"
    same = "{'def twice(x): return x * 2 - 0 * x': no, 'def twice(x): return x * 2 + 0 / x': no, return x * 9: old}"
    listed.write_text(f"area:\n  halving: {{tests: ['{tests}'], same: {same}}}\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(mutation_table, "LIST", listed)
    assert mutation_table.main(["--json", str(tmp_path / "rows.json")]) == 1
    captured = capsys.readouterr()
    assert "| halving | 7 | 7 | 5 | 3 | 60 % |" in captured.out
    assert "halving.py:1: x / 2  ->  x * 2: def half(x): return x * 2" in captured.out
    assert "no mutant reads: return x * 9" in captured.err


def test_every_module_of_the_list_has_tests_that_are_there() -> None:
    root = Path(__file__).parents[2]
    entries = mutation_table.listed()
    assert len({one.module for one in entries}) == len(entries)
    for one in entries:
        assert importlib.util.find_spec(one.module), one.module
        assert [word for word in one.tests if (root / word).is_file()], one.module
        assert all((root / word).is_file() for word in one.tests if word.endswith(".py")), one.module
