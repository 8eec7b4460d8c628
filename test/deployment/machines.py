"""Three machines on one: the vehicle, the topside computer at the other end of its tether, and a stranger elsewhere.

Each is a network namespace. The tether is 192.168.77.0/24; the stranger shares another network with the vehicle, knows
the vehicle's tether address and has a route to it.
"""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = [str(folder) for folder in sorted((ROOT / "src").glob("hindrax_*")) if folder.name != "hindrax_msgs"]
VEHICLE, TOPSIDE, STRANGER = "192.168.77.2", "192.168.77.1", "10.77.0.9"
DOMAIN = "7"


def ip(*words: str) -> str:
    return subprocess.run(["ip", *words], check=True, capture_output=True, text=True, timeout=20).stdout


def require_namespaces() -> None:
    """Skip where the machine does not let tests make networks, and say why."""
    if not shutil.which("ip"):
        pytest.skip("needs `ip` of iproute2 to make network namespaces")
    name = f"hindrax-try-{os.getpid()}"
    try:
        ip("netns", "add", name)
    except subprocess.CalledProcessError as error:
        pytest.skip(f"may not make network namespaces here: {error.stderr.strip()}")
    ip("netns", "del", name)


@dataclass
class Machines:
    """Names of the namespaces, and what runs in them."""

    folder: Path
    vehicle: str = ""
    topside: str = ""
    elsewhere: str = ""
    running: list[subprocess.Popen[str]] = field(default_factory=list)

    def start(self, machine: str, words: Sequence[str], **settings: str) -> subprocess.Popen[str]:
        """Start a program on a machine; its stderr goes to NAME.err."""
        own = ("HINDRAX_TETHER", "ROS_DOMAIN_ID", "FASTRTPS_DEFAULT_PROFILES_FILE")
        kept = {key: value for key, value in os.environ.items() if key not in own}
        paths = [*SOURCES, str(ROOT / "test/deployment"), *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = kept | {
            "PYTHONPATH": os.pathsep.join(paths),
            "ROS_DOMAIN_ID": DOMAIN,
            "HINDRAX_RUNTIME_DIR": str(self.folder / machine),
        }
        child = subprocess.Popen(
            ["ip", "netns", "exec", machine, sys.executable, "-u", *words],
            env=environment | settings,
            cwd=self.folder,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=self.errors(machine).open("a"),
            text=True,
        )
        self.running.append(child)
        return child

    def start_stranger(self, machine: str, asked: Sequence[str], seconds: float) -> subprocess.Popen[str]:
        """Start a process whose middleware knows no interfaces, only a discovery server."""
        peers = "".join(
            f"<locator><udpv4><address>{one}</address></udpv4></locator>" for one in ("239.255.0.1", *asked)
        )
        profile = self.folder / f"{machine}.xml"
        profile.write_text(
            '<?xml version="1.0"?><dds xmlns="http://www.eprosima.com"><profiles>'
            '<participant profile_name="stranger" is_default_profile="true"><rtps><builtin>'
            f"<initialPeersList>{peers}</initialPeersList></builtin></rtps></participant></profiles></dds>"
        )
        return self.start(
            machine,
            [str(ROOT / "test/deployment/stranger.py"), str(seconds)],
            FASTRTPS_DEFAULT_PROFILES_FILE=str(profile),
            FASTDDS_BUILTIN_TRANSPORTS="UDPv4",
            ROS_AUTOMATIC_DISCOVERY_RANGE="SYSTEM_DEFAULT",
        )

    def errors(self, machine: str) -> Path:
        return self.folder / f"{machine}.err"

    def tether(self, state: str) -> None:
        """Plug the far end of the tether in ("up") or pull it ("down"): the vehicle loses its carrier."""
        ip("-n", self.topside, "link", "set", "tether", state)

    def sent_bytes(self) -> int:
        """Bytes that the vehicle has sent over the tether."""
        (found,) = json.loads(ip("-j", "-s", "-n", self.vehicle, "link", "show", "tether"))
        return int(found["stats64"]["tx"]["bytes"])


@contextmanager
def three_machines(folder: Path) -> Iterator[Machines]:
    require_namespaces()
    vehicle, topside, elsewhere = names = [
        f"hindrax-{os.getpid()}-{what}" for what in ("vehicle", "topside", "elsewhere")
    ]
    made = Machines(folder, vehicle, topside, elsewhere)
    with ExitStack() as stack:
        for name in names:
            ip("netns", "add", name)
            stack.callback(ip, "netns", "del", name)
            ip("-n", name, "link", "set", "lo", "up")
        wire(made.vehicle, f"{VEHICLE}/24", made.topside, f"{TOPSIDE}/24", "tether")
        wire(made.vehicle, "10.77.0.2/24", made.elsewhere, f"{STRANGER}/24", "harbor")
        ip("-n", made.elsewhere, "route", "add", "192.168.77.0/24", "via", "10.77.0.2")
        ip("-n", made.elsewhere, "route", "add", "224.0.0.0/4", "dev", "harbor")
        stack.callback(end_all, made)
        yield made


def wire(here: str, address: str, there: str, other: str, name: str) -> None:
    ip("-n", here, "link", "add", name, "type", "veth", "peer", "name", name, "netns", there)
    for machine, one in ((here, address), (there, other)):
        ip("-n", machine, "addr", "add", one, "dev", name)
        ip("-n", machine, "link", "set", name, "up")


def end_all(machines: Machines) -> None:
    for child in reversed(machines.running):
        if child.poll() is None:
            child.terminate()
            try:
                child.wait(30)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()
