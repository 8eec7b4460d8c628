"""`hindrax deploy`: this clone onto another machine, and started there."""

from __future__ import annotations

import argparse
import shutil
import subprocess
from pathlib import Path

from hindrax_bringup.clone import clone_root
from hindrax_bringup.network.tether import parse_tether
from hindrax_bringup.stack_runner import report
from hindrax_cli.deployment.remote import looked, outline
from hindrax_cli.deployment.remote import run as run_step
from hindrax_cli.deployment.steps import DeploymentKind, Target, kind_of, plan
from hindrax_core.errors import HindraxError
from hindrax_core.text.screen_text import print_fitted, print_whole

NAME = "deploy"
HELP = "bring the last commit of this clone to another machine over ssh, set it up and start it there"
EXAMPLE = "./hindrax deploy pi@192.168.2.2 --tether eth0:192.168.2.1 --dry-run"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where to, and how it runs there."""
    parser.add_argument("host", metavar="HOST", help="as ssh takes it: pi@192.168.2.2, or a name of ~/.ssh/config")
    parser.add_argument("--dry-run", action="store_true", help="print each step, reach nobody")
    parser.add_argument(
        "--with",
        dest="kind",
        choices=[one.value for one in DeploymentKind],
        help="as a service of its ROS installation, or in the container; default: ROS where it is installed",
    )
    parser.add_argument("--tether", metavar="IFACE:TOPSIDE", default="", help="its interface to you, and your address")
    parser.add_argument("--folder", default="/opt/hindrax", help="where on it; default /opt/hindrax")
    parser.add_argument("--no-system", action="store_true", help="only bring and build; leave its services alone")


def run(arguments: argparse.Namespace) -> int:
    """Do every step, or say it."""
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
            outline(step, target.host, print_whole)
        else:
            report(title)
            run_step(target.host, step, clone)
    report("nothing was done: a dry run" if arguments.dry_run else f"done on {target.host}")
    return 0


def chosen_kind(arguments: argparse.Namespace) -> DeploymentKind:
    """Ask the machine; a dry run reaches nobody and shows the usual way."""
    if arguments.dry_run:
        return DeploymentKind.NATIVE
    return kind_of(arguments.host, looked(Target(arguments.host).host))


def require_tools(clone: Path) -> None:
    """HindraxError where something that a deployment needs here is missing."""
    for tool in ("ssh", "git"):
        if shutil.which(tool) is None:
            raise HindraxError(f"found no {tool} here; sudo apt install {tool.replace('ssh', 'openssh-client')}")
    if not (clone / ".git").exists():
        raise HindraxError(f"{clone}: is no git clone, and what is sent is its last commit; deploy from a clone")


def left_behind(clone: Path) -> None:
    """Say what is changed here and not committed: it is not sent."""
    words = ["git", "status", "--porcelain", "--untracked-files=no"]
    changed = subprocess.run(words, cwd=clone, capture_output=True, text=True, check=True).stdout.splitlines()  # noqa: S603  # our own words
    if changed:
        report(f"{len(changed)} changed files are not committed, so they are not sent")
