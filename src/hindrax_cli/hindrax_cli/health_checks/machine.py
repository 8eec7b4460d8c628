"""Checks of the machine itself: Python and ROS, disk, time, groups, processes left behind. Nothing is changed."""

import ctypes
import grp
import importlib.util
import os
import platform
import pwd
import shutil
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from hindrax_bag.run_folder import FIRST_YEAR, FREE_BYTES_WANTED
from hindrax_bringup.network import security
from hindrax_bringup.network.tether import Tether, address_of
from hindrax_bringup.process_state import Running, running
from hindrax_bringup.processes import EVERY
from hindrax_bringup.ros_graph import PROFILES, SHARED_MEMORY, full_shared_memory
from hindrax_bringup.stack_lock import FOLDER
from hindrax_bringup.stack_process import RUNNER
from hindrax_cli.health_checks import Check
from hindrax_core.errors import HindraxError

LIBRARIES = ("numpy", "scipy", "yaml", "rich", "textual", "serial", "smbus2", "mcap")
PYTHONS = ((3, 11), (3, 12))
GROUPS = ("dialout", "i2c", "gpio")
TIME_ERROR, STA_UNSYNC, MAX_ERROR_S = 5, 0x0040, 0.5
NODE_WORDS = tuple(f"hindrax_{room}.nodes." for room in ("drivers", "control", "ident", "bag", "sim"))
NODE_NAMES = tuple(process.name for process in EVERY)
LAUNCHERS = ("hindrax", "ros2", "launch")


def python() -> Check:
    """Version of Python, and the libraries that the stack needs."""
    version = f"Python {platform.python_version()} at {sys.executable}"
    lacking = [name for name in LIBRARIES if importlib.util.find_spec(name) is None]
    if sys.version_info[:2] not in PYTHONS:
        return Check("python", version, "wanted Python 3.11 or 3.12; run ./hindrax setup")
    if lacking:
        return Check("python", f"{version}, without {', '.join(lacking)}", "run ./hindrax setup")
    return Check("python", f"{version}, {len(LIBRARIES)} libraries")


def ros(environment: Mapping[str, str] = os.environ) -> Check:
    """The client library and our own messages, and which graph this terminal would join."""
    lacking = [name for name in ("rclpy", "hindrax_msgs") if importlib.util.find_spec(name) is None]
    if lacking:
        return Check("ros", f"no {' and no '.join(lacking)}", "run ./hindrax setup, and start tools with ./hindrax")
    distribution = environment.get("ROS_DISTRO", "unknown distribution")
    graph = f"domain {environment.get('ROS_DOMAIN_ID', '0')}"
    middleware = environment.get("RMW_IMPLEMENTATION", "its default middleware")
    if distribution != "jazzy":
        return Check("ros", f"ROS 2 {distribution}", "wanted jazzy; open a terminal that sources no other ROS")
    return Check("ros", f"ROS 2 jazzy, {middleware}, {graph}")


def protection(tether: Tether | None, environment: Mapping[str, str] = os.environ) -> Check:
    """What keeps others from commanding the vehicle in the graph of this terminal."""
    name, keystore = "protection", environment.get(security.KEYSTORE, "")
    if keystore:
        try:
            security.settings(keystore, environment)
        except HindraxError as error:
            found, _, remedy = str(error).partition("; ")
            return Check(name, found, remedy or f"unset {security.KEYSTORE}")
        lacking = [one for one in security.enclaves() if not (Path(keystore) / f"enclaves{one}" / "key.pem").is_file()]
        of_whom = "of the operator only" if "/hindrax/operator" not in lacking and lacking else "of every process"
        return Check(name, f"SROS2 enforced: every process proves who it is ({keystore}, keys {of_whom})")
    if (profile := next((environment[one] for one in PROFILES if environment.get(one)), "")) and tether is None:
        return Check(name, f"your profile {profile} decides who is reached; nothing is signed")
    reach = "this machine" if tether is None else f"this machine and everybody on {tether.interface}"
    return Check(name, f"network only: {reach} may command; nothing is signed (docs/how-to/sign-the-graph.md)")


def disk(folder: Path) -> Check:
    """Room for bags."""
    free = shutil.disk_usage(folder).free
    text = f"{free / 1e9:.1f} GB free at {folder}"
    if free < FREE_BYTES_WANTED:
        return Check("disk", text, f"wanted {FREE_BYTES_WANTED / 1e9:.1f} GB; move old bags away or use --out")
    return Check("disk", text)


def shared_memory(place: Path = SHARED_MEMORY) -> Check:
    """Room for what ROS maps: without any it ends with a bus error."""
    found, _, remedy = full_shared_memory(place).partition("; ")
    return Check("shared memory", found or f"room in {place}", remedy)


@dataclass(frozen=True, slots=True)
class KernelTime:
    """Kernel clock: whether it is disciplined, and the bound of its error [s]."""

    synchronized: bool
    error_s: float


class _Timex(ctypes.Structure):
    """Return `struct timex` of Linux (adjtimex(2)), up to the fields that are read here."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("frequency", ctypes.c_long),
        ("max_error_us", ctypes.c_long),
        ("estimated_error_us", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_byte * 512),
    )


def kernel_time() -> KernelTime:
    """Ask the kernel; reading needs no rights."""
    timex = _Timex()
    state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.byref(timex))
    return KernelTime(0 <= state < TIME_ERROR and not timex.status & STA_UNSYNC, timex.max_error_us / 1e6)


def clock(kernel: KernelTime, now_s: float) -> Check:
    """Whether stamps of two machines can be compared: a request to arm that seems old is refused."""
    date = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime(now_s))
    if time.gmtime(now_s).tm_year < FIRST_YEAR:
        remedy = "set it: connect a network with NTP, or `sudo date -s`"
        return Check("time", f"{date}: the clock was never set", remedy)
    if not kernel.synchronized:
        remedy = "start chrony or systemd-timesyncd; without internet let the vehicle follow the topside computer"
        return Check("time", f"{date}, not synchronized", remedy)
    if kernel.error_s > MAX_ERROR_S:
        return Check("time", f"{date}, error up to {kernel.error_s:.2f} s", f"wanted {MAX_ERROR_S:g} s; wait for NTP")
    return Check("time", f"{date}, synchronized, error at most {1e3 * kernel.error_s:.0f} ms")


def groups() -> Check:
    """Membership in the groups that own serial ports and I2C buses; root needs none."""
    user = pwd.getpwuid(os.getuid()).pw_name
    if os.getuid() == 0:
        return Check("groups", "root: may open everything")
    existing = {group.gr_name: group.gr_gid for group in grp.getgrall() if group.gr_name in GROUPS}
    lacking = sorted(name for name, number in existing.items() if number not in os.getgroups())
    if lacking:
        remedy = f"sudo usermod -aG {','.join(lacking)} {user}, then log in again"
        return Check("groups", f"{user} is not in {', '.join(lacking)}", remedy)
    return Check("groups", f"{user} is in {', '.join(sorted(existing)) or 'no special group, and none exists here'}")


def _is_node(one: Running) -> bool:
    return any(word in one.words for word in NODE_WORDS) or (RUNNER in one.words and one.name in NODE_NAMES)


def leftovers(found: list[Running], user: int, place: str = "") -> Check:
    """Find our nodes whose parent has died: they hold ports, and may answer in the wrong graph.

    A parent with number 1 is the system's, unless that is our own tool, as in a container. Whose stacks are announced
    elsewhere (another service, a test) is not ours to judge.

    Parameters
    ----------
    found
        All processes.
    user
        Whose are looked at.
    place
        Where their stacks are announced; empty: in the usual place.

    Returns
    -------
    Check
        With the command that ends them.
    """
    first = next((one.words for one in found if one.pid == 1), "")
    if any(word in first for word in LAUNCHERS):
        return Check("processes", "looked after by the first process")
    ours = [one for one in found if (one.owner, one.place) == (user, place)]
    lost = [one for one in ours if one.parent == 1 and _is_node(one)]
    if lost:
        numbers = " ".join(str(one.pid) for one in lost)
        return Check("processes", f"{len(lost)} left behind: {lost[0].words}", f"end them: kill {numbers}")
    return Check("processes", "none left behind")


def machine(folder: Path) -> list[Check]:
    """All checks of the machine that hold in mock too."""
    processes = leftovers(list(running()), os.getuid(), os.environ.get(FOLDER, ""))
    return [python(), ros(), disk(folder), shared_memory(), processes]


def tether(named: Tether | None) -> list[Check]:
    """The interface to the other machine, where one is named."""
    if named is None:
        return []
    try:
        address = address_of(named.interface)
    except HindraxError as error:
        found, _, remedy = str(error).partition("; ")
        return [Check("tether", found, remedy)]
    return [Check("tether", f"{named.interface} is {address}; at its other end {', '.join(named.peers) or 'any peer'}")]


def vehicle_machine(named: Tether | None = None) -> list[Check]:
    """Checks that only a machine with real devices must pass."""
    return [clock(kernel_time(), time.time()), groups(), protection(named)]
