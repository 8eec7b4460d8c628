"""Wrong use costs one sentence that names the word, with the one that was perhaps meant, and exit code 2."""

import os
import subprocess
import sys
from subprocess import CompletedProcess

import pytest

from hindrax_bringup import cli
from hindrax_bringup.commands import test as test_command


def refused(capsys, *words: str) -> str:
    try:
        code = cli.main(words)
    except SystemExit as end:
        code = end.code
    said = capsys.readouterr()
    assert code == 2
    assert said.out == ""
    assert len(said.err.splitlines()) == 1
    return said.err


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["pooltest"], "no command 'pooltest' (did you mean pool-test?); ./hindrax --help lists all"),
        (["pool_test"], "did you mean pool-test?"),
        (["frobnicate"], "no command 'frobnicate'; ./hindrax --help lists all"),
        (["pool-test", "--mok"], "no option '--mok' (did you mean --mock?); ./hindrax pool-test --help shows how"),
        (["pool-test", "--dof", "surg"], "invalid choice: 'surg' (choose from 'surge', 'sway'"),
        (["pool-test", "--mock", "--excitation", "sinus"], "invalid choice: 'sinus' (choose from 'plateaus'"),
        (["pool-test", "--seed", "x"], "--seed: invalid seed value: 'x'"),
        (["pool-test", "--mock", "--out", "/proc/nowhere"], "/proc/nowhere cannot be written"),
        (["bag", "inof"], "invalid choice: 'inof'"),
        (["bag", "info"], "hindrax bag info: the following arguments are required: BAG"),
        (["monitor"], "found no terminal to draw on, wanted one; over ssh use `ssh -t`"),
        (["hold", "depht"], "invalid choice: 'depht'"),
    ],
)
def test_one_sentence(capsys, words, sentence):
    assert sentence in refused(capsys, *words)


def test_no_word_at_all_shows_every_command(capsys):
    assert cli.main([]) == 2
    said = capsys.readouterr().out
    assert all(f"  {name.replace('_', '-')} " in said for name in cli.module_names())


@pytest.mark.parametrize("words", [["-k", "dvl75"], ["test/golden", "-k", "dvl75"], ["-x", "--", "-q"]])
def test_options_of_pytest_reach_pytest(monkeypatch, words):
    called = []
    monkeypatch.setattr(
        test_command.subprocess, "run", lambda command, **_: called.append(command) or CompletedProcess(command, 0)
    )
    assert cli.main(["test", *words]) == 0
    assert called == [[sys.executable, "-m", "pytest", *words]]


@pytest.mark.parametrize("buffered", [{}, {"PYTHONUNBUFFERED": "1"}])
def test_a_reader_that_has_seen_enough_costs_no_traceback(buffered):
    tool = [sys.executable, "-m", "hindrax_bringup.cli", "--help"]
    here, there = os.pipe()
    os.close(here)
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    done = subprocess.run(
        tool, stdout=there, stderr=subprocess.PIPE, env=environment | buffered, timeout=60, check=False
    )
    os.close(there)
    assert (done.returncode, done.stderr) == (0, b"")


def test_control_c_while_a_command_is_loaded_is_one_sentence(monkeypatch, capsys):
    def interrupted(_name):
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "load", interrupted)
    assert cli.main(["papers"]) == 1
    assert capsys.readouterr().err == "hindrax: stopped by Ctrl-C\n"
