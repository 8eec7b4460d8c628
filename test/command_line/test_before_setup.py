"""Help, version and completion with nothing but a Python: no site packages, no environment."""

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hindrax_bringup.clone import clone_root
from hindrax_cli import command_page
from hindrax_cli.command import MODULES
from hindrax_sim.conditions.world_table import CONDITIONS
from hindrax_sim.faults.fault_registry import FAULTS
from hindrax_sim.simulators import SIMULATORS

ASK = """
import sys
from pathlib import Path
sys.path[:0] = [str(folder) for folder in Path(sys.argv[1]).glob("src/hindrax_*")]
from hindrax_cli.command_page import main
sys.exit(main(Path(sys.argv[1]), sys.argv[2:]))
"""
PAGE = command_page.page_of(clone_root())
VALUES = command_page.values_of(clone_root())
COMPLETE = """
COMP_WORDS=(./hindrax "$@") COMP_CWORD=$#
_hindrax
echo "${COMPREPLY[@]}"
"""


LOADED = """
print(*(module.__file__ for name, module in list(sys.modules.items()) if name.startswith("hindrax_")), sep="\\n")
"""


def asked(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-I", "-S", "-c", ASK, str(clone_root()), *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


def completed(*words: str) -> list[str]:
    script = command_page.completion(PAGE, "bash", VALUES) + COMPLETE
    done = subprocess.run(
        ["bash", "-c", script, "bash", *words], capture_output=True, text=True, check=True, timeout=60
    )
    return done.stdout.split()


def test_the_overview_lists_every_command() -> None:
    done = asked("--help")
    assert done.returncode == 0, done.stderr
    assert all(f"  {name} " in done.stdout for name in MODULES)


def test_the_version_is_reported() -> None:
    assert asked("--version").stdout.startswith("hindrax 0.")


@pytest.mark.parametrize("name", MODULES)
def test_every_command_has_its_help_on_the_page(name: str) -> None:
    text = command_page.help_of(PAGE, [name])
    assert text is not None
    assert text.startswith(f"usage: ./hindrax {name} ")


def test_help_of_a_command_and_of_a_word_of_one() -> None:
    done = asked("pool-test", "--help")
    assert done.returncode == 0, done.stderr
    assert "\n  --mock                    fly the mock vehicle instead of the one on this machine\n" in done.stdout
    assert "surge|sway|heave" in done.stdout
    assert "such as 2%: " in done.stdout
    assert "usage: ./hindrax bag info [OPTIONS]\n" in asked("bag", "info", "-h").stdout


def test_the_words_of_a_command_are_listed_with_what_they_do() -> None:
    assert re.search(r"^  recover  +Recover a truncated or damaged bag", asked("bag", "--help").stdout, re.MULTILINE)


@pytest.mark.parametrize("words", [["bag", "info"], ["setup"]])
def test_help_may_stand_before_the_command_too(words: list[str]) -> None:
    tool = str(clone_root() / "hindrax")
    before, behind = (
        subprocess.run([tool, *order], capture_output=True, text=True, check=True).stdout
        for order in (["help", *words], [*words, "--help"])
    )
    assert before == behind


def test_an_unknown_command_is_wrong_use() -> None:
    done = asked("pol-test", "--help")
    assert done.returncode == 2
    assert "no command 'pol-test' (did you mean pool-test?)" in done.stderr


def test_bash_completes_commands_their_words_options_and_choices() -> None:
    assert completed("po") == ["pool-test"]
    assert {"setup", "completion", "bag"} <= set(completed(""))
    assert completed("bag", "inf") == ["info"]
    assert completed("bag", "extract", "--c") == ["--csv"]
    assert completed("pool-test", "--dof", "sur") == ["surge"]
    assert completed("--v") == ["--version"]
    assert completed("pool-test", "--mock", "--vehicle", "hin") == ["hindrax"]
    assert set(completed("up", "--vehicle", "")) == set(VALUES["--vehicle"]) >= {"hindrax", "bluerov2-heavy"}
    assert completed("vehicle", "show", "lb") == ["lbv"]


def test_bash_completes_the_values_of_an_option() -> None:
    assert completed("up", "--mock", "--world", "tether_") == ["tether_drag"]
    assert set(completed("mock", "--world", "")) == {"ideal", "pool", *CONDITIONS}
    assert set(completed("doctor", "--mock", "--fault", "")) == set(FAULTS)
    assert completed("pool-test", "--mock", "--simulator", "") == list(SIMULATORS)


def test_the_options_of_the_set_up_are_completed_as_its_help_names_them() -> None:
    done = subprocess.run(
        [str(clone_root() / "hindrax"), "setup", "--help"], capture_output=True, text=True, check=True
    )
    assert set(completed("setup", "--")) == {*re.findall(r"^  (--\S+)", done.stdout, re.MULTILINE), "--help"}


@pytest.mark.skipif(shutil.which("fish") is None, reason="no fish on this machine")
def test_fish_offers_files_only_where_no_word_is_due(tmp_path: Path) -> None:
    (tmp_path / "a-file.txt").write_text("")
    asked_for = ("", "bag ", "bag info ", "replay ")
    script = command_page.completion(PAGE, "fish", VALUES) + "".join(
        f"complete -C'hindrax {one}'; echo =\n" for one in asked_for
    )
    done = subprocess.run(
        ["fish", "--no-config"],
        input=script,
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
        env=os.environ | {"HOME": str(tmp_path)},
        timeout=60,
    )
    first, words, info, replay = ({line.split("\t")[0] for line in part.split()} for part in done.stdout.split("=")[:4])
    assert "pool-test" in first
    assert {"info", "recover"} <= words
    assert "a-file.txt" not in first | words
    assert "a-file.txt" in info
    assert "info" not in info
    assert "a-file.txt" in replay


@pytest.mark.skipif(shutil.which("zsh") is None, reason="no zsh on this machine")
def test_a_zsh_without_completion_of_its_own_gets_it_and_keeps_its_home_clean(tmp_path: Path) -> None:
    script = command_page.completion(PAGE, "zsh", VALUES) + "print -r -- ${_comps[hindrax]}\n"
    done = subprocess.run(
        ["zsh", "-f"],
        input=script,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"HOME": str(tmp_path)},
    )
    assert "_hindrax" in done.stdout
    assert not done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("shell", command_page.SHELLS)
def test_every_shell_gets_its_script_before_a_set_up(shell: str) -> None:
    done = asked("completion", shell)
    assert done.returncode == 0, done.stderr
    assert done.stdout == command_page.completion(PAGE, shell, VALUES)
    assert done.stdout.startswith(f"# Completion of hindrax for {shell}")
    assert all(f"--{option}" in done.stdout for option in ("mock", "dof", "json"))


@pytest.mark.parametrize("words", [("--help",), ("bag", "--help"), ("--version",), ("completion", "bash")])
def test_what_answers_is_read_by_python_3_9(words: tuple[str, ...]) -> None:
    """It evaluates annotations unless told not to, and `str | None` is an error there."""
    script = ASK.replace("sys.exit(main(Path(sys.argv[1]), sys.argv[2:]))", "main(Path(sys.argv[1]), sys.argv[2:])")
    command = [sys.executable, "-I", "-S", "-c", script + LOADED, str(clone_root()), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    files = [line for line in done.stdout.splitlines() if line.startswith(str(clone_root())) and line.endswith(".py")]
    assert any(file.endswith("command_page.py") for file in files)
    for file in files:
        tree = ast.parse(Path(file).read_text(), feature_version=(3, 9))
        reported = any(isinstance(node, ast.ImportFrom) and node.module == "__future__" for node in tree.body)
        annotated = any(isinstance(node, ast.AnnAssign | ast.FunctionDef) for node in ast.walk(tree))
        assert reported or not annotated, file
