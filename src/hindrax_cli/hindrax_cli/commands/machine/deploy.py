"""`hindrax deploy`: this clone onto another machine, and started there.

The machine is reached by ssh: one connection for all steps, so that a password is asked for once.
"""

import argparse
import shutil
import subprocess
import sys
from pathlib import Path

from hindrax_bringup.clone import clone_root
from hindrax_bringup.network.tether import parse_tether
from hindrax_bringup.stack_lock import runtime_folder
from hindrax_cli.command import command, option
from hindrax_cli.deployment import LOOK, DeploymentKind, DeploymentStep, Target, kind_of, plan
from hindrax_core.errors import HindraxError
from hindrax_core.text.screen_text import print_fitted, print_stderr, print_whole

NO_CONNECTION = 255
"""Exit code of ssh's own errors (ssh(1))."""


@command(
    "./hindrax deploy pi@192.168.2.2 --tether eth0:192.168.2.1 --dry-run",
    option("host", metavar="HOST", help="as ssh takes it: pi@192.168.2.2, or a name of ~/.ssh/config"),
    option("--dry-run", action="store_true", help="print each step, connect to nothing"),
    option(
        "--with",
        dest="kind",
        choices=[one.value for one in DeploymentKind],
        help="as a service of its ROS installation, or in the container; default: ROS where it is installed",
    ),
    option("--tether", metavar="IFACE:TOPSIDE", default="", help="its interface to you, and your address"),
    option("--folder", default="/opt/hindrax", help="where on it; default /opt/hindrax"),
    option("--no-system", action="store_true", help="only send and build; do not change its services"),
)
def deploy(arguments: argparse.Namespace) -> int:
    """Send the last commit of this clone to another machine over ssh, set it up and start it there."""
    parse_tether(arguments.tether)
    clone = clone_root()
    require_tools(clone)
    target = Target(
        arguments.host,
        arguments.folder,
        DeploymentKind(arguments.kind) if arguments.kind else chosen_kind(arguments),
        arguments.tether,
        system=not arguments.no_system,
    )
    left_behind(clone)
    steps = plan(target)
    for number, step in enumerate(steps, start=1):
        title = f"[{number}/{len(steps)}] {step.title}"
        if arguments.dry_run:
            print_fitted(title)
            outline(step, target.host)
        else:
            print_stderr(title)
            run(target.host, step, clone)
    print_stderr("dry run: nothing was changed" if arguments.dry_run else f"done on {target.host}")
    return 0


def chosen_kind(arguments: argparse.Namespace) -> DeploymentKind:
    """Ask the machine; a dry run connects to nothing and shows the usual way."""
    if arguments.dry_run:
        return DeploymentKind.NATIVE
    return kind_of(arguments.host, looked(Target(arguments.host).host))


def require_tools(clone: Path) -> None:
    """HindraxError where something that a deployment needs here is missing."""
    for tool in ("ssh", "git"):
        if shutil.which(tool) is None:
            raise HindraxError(f"found no {tool} here; sudo apt install {tool.replace('ssh', 'openssh-client')}")
    if not (clone / ".git").exists():
        raise HindraxError(f"{clone}: is no git clone, and deploy sends the last commit; deploy from a clone")


def left_behind(clone: Path) -> None:
    """Say what is changed here and not committed: it is not sent."""
    words = ["git", "status", "--porcelain", "--untracked-files=no"]
    changed = subprocess.run(words, cwd=clone, capture_output=True, text=True, check=True).stdout.splitlines()  # noqa: S603  # our own words
    if changed:
        print_stderr(f"{len(changed)} changed files are not committed, so they are not sent")


def ssh(host: str, script: str) -> list[str]:
    """Words that run a script on another machine; it ends at the first line that fails."""
    shared = [f"ControlPath={runtime_folder()}/ssh-%C", "ControlMaster=auto", "ControlPersist=60", "ConnectTimeout=15"]
    options = [word for one in shared for word in ("-o", one)]
    terminal = ["-t"] if sys.stdin.isatty() and "sudo " in script else []
    return ["ssh", *options, *terminal, host, f"set -e\n{script}"]


def looked(host: str) -> str:
    """Answer of a machine to LOOK. HindraxError when it does not answer."""
    done = subprocess.run(ssh(host, LOOK), stdout=subprocess.PIPE, text=True, check=False)  # noqa: S603  # the user's own host
    _require(done.returncode, host, DeploymentStep("look", LOOK))
    return done.stdout.strip()


def run(host: str, step: DeploymentStep, clone: Path) -> None:
    """Run one step to its end.

    Parameters
    ----------
    host
        As ssh takes it.
    step
        Script for the host, and what feeds its input.
    clone
        Folder in which the feeder runs.

    Raises
    ------
    HindraxError
        Says which step failed and what to do.
    """
    feeder = subprocess.Popen(step.feed, cwd=clone, stdout=subprocess.PIPE) if step.feed else None  # noqa: S603  # our own words
    try:
        source = feeder.stdout if feeder else subprocess.DEVNULL if not sys.stdin.isatty() else None
        code = subprocess.run(ssh(host, step.script), stdin=source, check=False).returncode  # noqa: S603  # as above
    finally:
        if feeder and feeder.stdout:
            feeder.stdout.close()
    if feeder and feeder.wait() and not code:
        raise HindraxError(f"{step.title}: {' '.join(step.feed)} ended with code {feeder.returncode}")
    _require(code, host, step)


def _require(code: int, host: str, step: DeploymentStep) -> None:
    if code == NO_CONNECTION:
        raise HindraxError(f"{step.title}: ssh does not reach {host}; try `ssh {host}` in a terminal")
    if code:
        raise HindraxError(f"{step.title}: failed on {host} with code {code}; {step.remedy}")


def outline(step: DeploymentStep, host: str) -> None:
    """Describe what a step would run, without the options of the connection."""
    lines = step.script.splitlines()
    feed = f"{' '.join(step.feed)} | " if step.feed else ""
    print_whole(f"  {feed}ssh {host} {lines[0]}")
    for line in lines[1:]:
        print_whole(f"      {line}")
