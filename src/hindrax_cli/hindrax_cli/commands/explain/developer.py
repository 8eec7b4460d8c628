"""For the shell and the code, in a clone: `hindrax completion`, `test` and `reference`."""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from hindrax_bringup.clone import VEHICLE_SETUP, WHOLE_SETUP, clone_root, developer_module, is_vehicle_setup
from hindrax_cli import command_page
from hindrax_cli.command import command, option
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_fitted, print_stderr, print_whole
from hindrax_core.text.text_file import writing

PYTEST = [sys.executable, "-m", "pytest"]
WORKERS = len(os.sched_getaffinity(0)) + 2
"""Two more than there are cores: tests with real processes wait half of their time."""
ALL = [*PYTEST, "-n", str(WORKERS), "--durations", "10"]
QUICK = (
    ("style", [sys.executable, "-m", "ruff", "check", "--quiet"]),
    ("format", [sys.executable, "-m", "ruff", "format", "--check", "--quiet"]),
    ("imports", [sys.executable, "-c", "from importlinter.cli import lint_imports_command as c; c()"]),
    ("collection", [*PYTEST, "--collect-only", "-qqq"]),
)
"""What is checked before the tests. Collected once, they are compiled for all workers: each would do it for itself."""
DURING_TESTS = {
    "types": [sys.executable, "-m", "mypy"],
    "site": [sys.executable, "-m", "hindrax_tools.site.build"],
}
"""What runs while the tests do."""


@command("./hindrax completion bash", option("shell", choices=command_page.SHELLS, help="which shell"))
def completion(arguments: argparse.Namespace) -> int:
    """Print the completion script for a shell; its first line says where to save it."""
    root = clone_root()
    page, values = command_page.page_of(root), command_page.values_of(root)
    print_whole(command_page.completion(page, arguments.shell, values), end="")
    return 0


@command(
    "./hindrax test test/golden -k dvl75",
    option("arguments", nargs=argparse.REMAINDER, metavar="PYTEST ARGS", help="arguments of pytest"),
    passes_on=True,
)
def test(arguments: argparse.Namespace) -> int:
    """All checks and tests, on all cores; with arguments, only pytest with these."""
    root = clone_root()
    if is_vehicle_setup():
        raise UsageError(f"{VEHICLE_SETUP}, without pytest; {WHOLE_SETUP}")
    words = arguments.arguments[1:] if arguments.arguments[:1] == ["--"] else arguments.arguments
    if words:
        return 0 if good("tests", [*PYTEST, *words], root) else 1
    with contextlib.ExitStack() as running:
        beside = {name: _Beside(running, command, root) for name, command in DURING_TESTS.items()}
        print_fitted(f"== {' and '.join(DURING_TESTS)}: checked during the tests")
        passed = [good(name, command, root, told=name != "collection") for name, command in QUICK]
        passed.append(good("tests", ALL, root))
        for name, one in beside.items():
            passed.append(code_of(one.process) == 0)
            one.output.seek(0)
            print_whole(f"{one.output.read()}== {name}: {'good' if passed[-1] else 'FAILED'}")
    return 0 if all(passed) else 1


class _Beside:
    """A check that runs while the tests do; its output is kept until they have ended."""

    def __init__(self, running: contextlib.ExitStack, command: list[str], root: Path) -> None:
        self.output = tempfile.TemporaryFile("w+")  # noqa: SIM115  # the stack of contexts closes it
        running.enter_context(self.output)
        out = self.output
        self.process = subprocess.Popen(command, cwd=root, stdin=subprocess.DEVNULL, stdout=out, stderr=out)  # noqa: S603  # our own commands


def good(name: str, command: list[str], root: Path, *, told: bool = True) -> bool:
    """Run one check to its end, and print its result.

    Parameters
    ----------
    name
        In the headings.
    command
        Words of the process.
    root
        Folder in which it runs.
    told
        Whether its output is shown where all is good.

    Returns
    -------
    bool
        Whether its code was 0.
    """
    begin = time.monotonic()
    print_fitted(f"== {name}")
    with tempfile.TemporaryFile("w+") as output:
        out = None if told else output
        process = subprocess.Popen(command, cwd=root, stdin=subprocess.DEVNULL, stdout=out, stderr=out)  # noqa: S603  # our own commands
        code = code_of(process)
        if code:
            output.seek(0)
            print_whole(output.read(), end="")
    print_fitted(f"== {name}: {'good' if code == 0 else 'FAILED'} ({time.monotonic() - begin:.0f} s)")
    return code == 0


def code_of(process: subprocess.Popen[bytes]) -> int:
    """Wait; what Ctrl-C interrupts is left the time to end what it has started."""
    try:
        return process.wait()
    except KeyboardInterrupt:
        process.wait()
        raise


def _what(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--check", action="store_true", help="only list stale pages (the default); exit code 1 if any")
    what.add_argument("--write", action="store_true", help="write stale files: pages, access policies, stubs")
    what.add_argument("--figures", action="store_true", help="redraw the figures of the explanation")
    what.add_argument("--site", action="store_true", help="build the site of the documentation into --out")
    what.add_argument("--example-data", action="store_true", help="make the example data in --out: a run, and a log")
    what.add_argument("--fly", action="store_true", help="repeat the flights of the figures, then draw them")


@command(
    "./hindrax reference --write\n# flies sixteen pool tests, then draws the figures:\n./hindrax reference --fly",
    _what,
    option("--out", type=Path, metavar="DIR", help="folder of the output"),
    option("--repository", default="", metavar="URL", help="with --site: where its files are, such as .../blob/v0.2.0"),
)
def reference(arguments: argparse.Namespace) -> int:
    """Write the reference pages in docs/reference from the code, or check that they are up to date."""
    if arguments.site:
        return int(developer_module("site.build").build(clone_root(), _required(arguments), arguments.repository))
    if arguments.example_data:
        developer_module("example_data").make(_required(arguments))
        return 0
    docs, pages = clone_root() / "docs", developer_module("reference")
    if arguments.figures or arguments.fly:
        return _draw(arguments.out or docs / "explanation" / "figures", again=arguments.fly)
    folder = arguments.out or docs / "reference"
    if arguments.write:
        for name in pages.write(folder):
            print_fitted(folder / name)
        if arguments.out is None:
            _write_policies()
            for part in ("message_stubs", "readmes"):
                for file in developer_module(f"reference.{part}").write(clone_root()):
                    print_fitted(file)
        return 0
    stale = pages.stale(folder)
    if stale:
        raise HindraxError(f"{folder}: stale are {', '.join(stale)}; `{pages.COMMAND}` writes them")
    print_stderr(f"{folder}: up to date")
    return 0


def _required(arguments: argparse.Namespace) -> Path:
    if arguments.out is None:
        raise UsageError("reference: found no --out, wanted the folder to write to")
    out: Path = arguments.out
    with writing(f"--out {out}", "name another place"):
        out.mkdir(parents=True, exist_ok=True)
    return out


def _write_policies() -> None:
    from hindrax_bringup.network.security import policies  # noqa: PLC0415  # completion answers before YAML is installed
    from hindrax_bringup.share_files import share_folder  # noqa: PLC0415  # as above

    file, text = share_folder("security") / "policies.xml", policies()
    if file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")
        print_fitted(file.resolve())


def _draw(folder: Path, *, again: bool) -> int:
    # Imported here: matplotlib takes long to load.
    figures = developer_module("reference.figures")
    if again:
        flown = []
        for flight in figures.FLIGHTS:
            print_stderr("flying with seed {}, true thrust over thrust of the curve {}".format(*flight))
            flown.append(figures.flown(*flight))
        kept = [flown[0], *({key: one[key] for key in one if key != "online"} for one in flown[1:])]
        (folder / figures.FLIGHTS_FILE).write_text(json.dumps(kept) + "\n", encoding="utf-8")
    for file in figures.draw(folder):
        print_fitted(file)
    return 0
