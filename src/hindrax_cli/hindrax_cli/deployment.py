"""The steps of a deployment, as data: title, remote script, and the local command that feeds it."""

import re
import shlex
from dataclasses import dataclass
from enum import StrEnum

from hindrax_core.errors import HindraxError, UsageError

HEALTHY_S, STEADY_S = 120, 15
"""How long a stack may take to be healthy, and how long it then has to be: a device may fail after its first report."""
ROS = "/opt/ros/jazzy/setup.bash"


class DeploymentKind(StrEnum):
    """Way to run the stack there: as a service of a ROS installation, or in the container."""

    NATIVE = "native"
    CONTAINER = "container"


@dataclass(frozen=True, slots=True)
class Target:
    """Machine, folder, way to run, and tether; `system` False leaves services unchanged."""

    host: str
    folder: str = "/opt/hindrax"
    kind: DeploymentKind = DeploymentKind.NATIVE
    tether: str = ""
    system: bool = True

    def __post_init__(self) -> None:
        """Refuse what ssh or colcon would misread."""
        if not self.host or self.host.startswith("-"):
            raise UsageError(f"host: found {self.host!r}, wanted one as ssh takes it: pi@192.168.2.2")
        if not re.fullmatch(r"(/[\w.+-]+)+", self.folder, re.ASCII):
            raise UsageError(f"--folder: found {self.folder!r}, wanted an absolute path of plain letters: /opt/hindrax")


@dataclass(frozen=True, slots=True)
class DeploymentStep:
    """One command on the other machine, a shell script of one or more lines, and the command here that feeds it."""

    title: str
    script: str
    feed: tuple[str, ...] = ()
    remedy: str = "the lines above say why"


LOOK = f"""uname -sm
test ! -e {ROS} || echo ros
command -v docker || true"""
"""Script that reports a machine's system and what is installed."""


def kind_of(host: str, answer: str) -> DeploymentKind:
    """Choose how the stack runs on a machine, by its answer to LOOK. HindraxError when it cannot."""
    system, *found = answer.split("\n")
    if "ros" in found or system == "Linux x86_64":
        return DeploymentKind.NATIVE
    if any(line.endswith("docker") for line in found):
        return DeploymentKind.CONTAINER
    raise HindraxError(
        f"{host}: found {system or 'nothing'} without {ROS} and without docker; "
        "install ROS 2 Jazzy (Ubuntu 24.04) or docker there: docs/how-to/fly-on-the-pi.md"
    )


def plan(target: Target) -> tuple[DeploymentStep, ...]:
    """All steps, in order. Each is idempotent."""
    system = _of_the_system(target) if target.system else (_made(target),)
    return (*_files(target.folder), *system)


def _files(folder: str) -> tuple[DeploymentStep, ...]:
    """The files of the last commit, and none of an earlier one; what was made there (.hindrax, runs) stays."""
    return (
        DeploymentStep(
            f"a folder of our own: {folder}",
            f"mkdir -p {folder} 2>&- || true\n"
            f"test -w {folder} || sudo install -d -o $(id -u) -g $(id -g) {folder}\n"
            f"mkdir -p {folder}/.hindrax",
        ),
        DeploymentStep(
            "files that are no longer there",
            f"cd {folder}\nLC_ALL=C sort >.hindrax/deployed.new\ntouch .hindrax/deployed\n"
            "LC_ALL=C comm -23 .hindrax/deployed .hindrax/deployed.new | tr '\\n' '\\0' | xargs -0 -r rm -f --",
            feed=("git", "-c", "core.quotepath=off", "ls-tree", "-r", "--name-only", "HEAD"),
        ),
        DeploymentStep(
            "the files of the last commit",
            f"cd {folder}\ntar -x -f - --warning=no-timestamp\nmv .hindrax/deployed.new .hindrax/deployed",
            feed=("git", "archive", "--format=tar", "HEAD"),
            remedy="is its disk full? `df -h` there shows",
        ),
    )


def _of_the_system(target: Target) -> tuple[DeploymentStep, ...]:
    words = ["sudo", f"{target.folder}/docker/pi/set-up.sh"]
    words += ["--container"] if target.kind is DeploymentKind.CONTAINER else []
    words += ["--tether", target.tether] if target.tether else []
    compose = f"docker compose -f {target.folder}/docker/compose.yaml"
    start, ask = f"{compose} up --detach", f"{compose} exec -T hindrax /opt/hindrax/hindrax health"
    tail = f"{compose} logs --tail 20"
    if target.kind is DeploymentKind.NATIVE:
        start = "sudo systemctl restart hindrax"
        ask = f"sudo -u hindrax HINDRAX_RUNTIME_DIR=/run/hindrax {target.folder}/hindrax health"
        tail = "sudo journalctl -u hindrax -n 20 --no-pager"
    return (
        DeploymentStep("boot settings, device names, groups, time, service", shlex.join(words)),
        _made(target),
        DeploymentStep("start", start),
        DeploymentStep("wait until it is healthy", _until(ask, tail), remedy="`./hindrax doctor` there finds out more"),
    )


def _made(target: Target) -> DeploymentStep:
    """Make what the clone needs there: environment and workspace, or the image."""
    if target.kind is DeploymentKind.CONTAINER:
        script = f"docker compose -f {target.folder}/docker/compose.yaml build"
        return DeploymentStep("build the image (the first time takes a quarter of an hour)", script)
    return DeploymentStep(
        "set up environment and workspace (the first time takes minutes)", f"{target.folder}/hindrax setup --vehicle"
    )


def _until(ask: str, tail: str) -> str:
    """Ask until it was healthy for STEADY_S, for HEALTHY_S of the monotonic clock, however long one answer takes."""
    return f"""uptime() {{ cut -d. -f1 /proc/uptime; }}
end=$(($(uptime) + {HEALTHY_S})) since=
while [ "$(uptime)" -le $end ]; do
  if text=$({ask} 2>&1); then
    since=${{since:-$(uptime)}}
    [ $(($(uptime) - since)) -ge {STEADY_S} ] && echo "$text" && exit
  else
    since=
  fi
  sleep 1
done
{tail}
echo "$text" >&2
exit 1"""
