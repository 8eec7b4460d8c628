"""A package of Python that the tool needs and cannot import: one sentence with the remedy, no traceback."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hindrax_cli import __main__ as start


@pytest.mark.parametrize("words", [["papers"], ["vehicle", "show", "hindrax"]])
def test_a_package_that_another_path_hides_is_named_with_the_path(tmp_path: Path, words: list[str]) -> None:
    (tmp_path / "yaml.py").write_text("raise ImportError('of another Python\\nand much more')\n", encoding="utf-8")
    path = os.pathsep.join([str(tmp_path), os.environ["PYTHONPATH"]])
    tool = [sys.executable, "-m", "hindrax_cli", *words]
    done = subprocess.run(
        tool, capture_output=True, text=True, timeout=60, check=False, env=os.environ | {"PYTHONPATH": path}
    )
    assert done.returncode == 1
    assert done.stderr == (
        f"hindrax: cannot be imported: of another Python; PYTHONPATH is {path}: `unset PYTHONPATH`; if that does not "
        "help, `./hindrax setup` completes the environment\n"
    )


def test_one_that_is_not_there_is_to_be_installed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)

    def run() -> int:
        raise ModuleNotFoundError("No module named 'numpy'", name="numpy")

    assert start._whole(run, "install it") == 1
    assert capsys.readouterr().err == "hindrax: cannot be imported: No module named 'numpy'; install it\n"
