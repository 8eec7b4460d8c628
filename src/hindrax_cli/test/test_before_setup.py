"""Help, version and completion with nothing but a Python: no site packages, no environment."""

from __future__ import annotations

import subprocess
import sys

import pytest

from hindrax_bringup.clone import clone_root
from hindrax_cli import command_line as cli
from hindrax_cli import command_page

ASK = """
import sys
from pathlib import Path
sys.path[:0] = [str(folder) for folder in Path(sys.argv[1]).glob("src/hindrax_*")]
from hindrax_cli.before_setup import main
sys.exit(main(Path(sys.argv[1]), sys.argv[2:]))
"""
PAGE = command_page.page_of(clone_root())
COMPLETE = """
COMP_WORDS=(./hindrax "$@") COMP_CWORD=$#
_hindrax
echo "${COMPREPLY[@]}"
"""


def asked(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-I", "-S", "-c", ASK, str(clone_root()), *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)


def completed(*words: str) -> list[str]:
    script = command_page.completion(PAGE, "bash") + COMPLETE
    done = subprocess.run(
        ["bash", "-c", script, "bash", *words], capture_output=True, text=True, check=True, timeout=60
    )
    return done.stdout.split()


def test_the_overview_lists_every_command() -> None:
    said = asked("--help")
    assert said.returncode == 0, said.stderr
    assert all(f"  {name.replace('_', '-')} " in said.stdout for name in cli.module_names())


def test_the_version_is_said() -> None:
    assert asked("--version").stdout.startswith("hindrax 0.")


@pytest.mark.parametrize("name", [name.replace("_", "-") for name in cli.module_names()])
def test_every_command_has_its_help_on_the_page(name: str) -> None:
    text = command_page.help_of(PAGE, [name])
    assert text is not None
    assert text.startswith(f"usage: ./hindrax {name} ")


def test_help_of_a_command_and_of_a_word_of_one() -> None:
    said = asked("pool-test", "--help")
    assert said.returncode == 0, said.stderr
    assert "\n  --mock                    fly the mock vehicle instead of the one on this machine\n" in said.stdout
    assert "surge|sway|heave" in said.stdout
    assert "such as 2%: " in said.stdout
    assert "usage: ./hindrax bag info [OPTIONS]\n" in asked("bag", "info", "-h").stdout


def test_an_unknown_command_is_wrong_use() -> None:
    said = asked("pol-test", "--help")
    assert said.returncode == 2
    assert "no command 'pol-test' (did you mean pool-test?)" in said.stderr


def test_bash_completes_commands_their_words_options_and_choices() -> None:
    assert completed("po") == ["pool-test"]
    assert {"setup", "completion", "bag"} <= set(completed(""))
    assert completed("bag", "inf") == ["info"]
    assert completed("bag", "extract", "--c") == ["--csv"]
    assert completed("pool-test", "--dof", "sur") == ["surge"]
    assert completed("setup", "--c") == ["--check"]


@pytest.mark.parametrize("shell", command_page.SHELLS)
def test_every_shell_gets_its_script_before_a_set_up(shell: str) -> None:
    said = asked("completion", shell)
    assert said.returncode == 0, said.stderr
    assert said.stdout == command_page.completion(PAGE, shell)
    assert said.stdout.startswith(f"# Completion of hindrax for {shell}")
    assert all(f"--{option}" in said.stdout for option in ("mock", "dof", "json"))
