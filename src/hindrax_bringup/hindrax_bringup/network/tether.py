"""The tether: the one network interface, besides loopback, over which the ROS graph may reach another machine.

It is named by `--tether` or by HINDRAX_TETHER as `IFACE` or `IFACE:PEER,PEER`: `eth0:192.168.2.1`. A middleware that
starts before the interface has carrier and address never discovers a peer there, so its starter waits first.
The profile of the middleware allows loopback and the tether, each restricted to its network by its netmask (ADR 13).
"""

import argparse
import fcntl
import hashlib
import ipaddress
import os
import re
import socket
import struct
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from hindrax_bringup.share_files import share_folder
from hindrax_bringup.stack_lock import runtime_folder
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.text_file import replace_text

SETTING = "HINDRAX_TETHER"
INTERFACES = Path("/sys/class/net")
SIOCGIFADDR = 0x8915
REQUEST = "16s16x"
"""`struct ifreq` (netdevice(7)): name, then a socket address."""
LOOK_S = 0.5
FOREVER_S = float("inf")
SPACE = "http://www.eprosima.com"
GROUP = "239.255.0.1"
"""Ports at which participants announce themselves (OMG DDSI-RTPS 2.3, section 9.6.1.4.1); allowed interfaces only."""
PARTICIPANTS = 32
"""Ports tried per peer: one for each participant on its machine."""
ANNOUNCED_S = "1"
"""Each announcement of each participant goes to every port of every peer, so there are fewer than on loopback."""


@dataclass(frozen=True, slots=True)
class Tether:
    """Name of the interface on this machine, and the addresses of those at its other end."""

    interface: str
    peers: tuple[str, ...] = ()


def parse_tether(words: str) -> Tether | None:
    """Read `IFACE` or `IFACE:PEER,PEER`; None for an empty text. UsageError names what is wrong."""
    if not words:
        return None
    interface, _, listed = words.partition(":")
    if interface == "lo":
        raise UsageError(
            f"tether {words!r}: lo leads to no other machine; without --tether the graph stays on this one"
        )
    if not re.fullmatch(r"[\w.-]{1,15}", interface, re.ASCII):
        raise UsageError(f"tether {words!r}: found interface {interface!r}, wanted one as `ip link` names them: eth0")
    peers = tuple(listed.split(",")) if listed else ()
    for peer in peers:
        try:
            ipaddress.IPv4Address(peer)
        except ValueError as error:
            raise UsageError(f"tether {words!r}: found peer {peer!r}, wanted an IPv4 address: 192.168.2.1") from error
    return Tether(interface, peers)


def tether_setting() -> Tether | None:
    """Return the tether that this terminal names, None when the graph stays on this machine."""
    return parse_tether(os.environ.get(SETTING, ""))


def available_tether(report: Callable[[str], None]) -> Tether | None:
    """Return the tether that this terminal names if it is there now, for work that does not wait for it."""
    tether = tether_setting()
    if tether is None:
        return None
    try:
        address_of(tether.interface)
    except HindraxError as error:
        report(f"without the tether: {error}")
        return None
    return tether


def _into_setting(words: str) -> str:
    """Set the environment variable, so that child processes inherit it."""
    try:
        parse_tether(words)
    except UsageError as error:
        raise argparse.ArgumentTypeError(str(error)) from error
    os.environ[SETTING] = words
    return words


def add_tether(parser: argparse.ArgumentParser) -> None:
    """Interface to the other machine."""
    parser.add_argument(
        "--tether",
        type=_into_setting,
        metavar="IFACE[:PEER,...]",
        help=f"interface to the other machine and its address, eth0:192.168.2.1; default {SETTING}, else none",
    )


def address_of(interface: str, interfaces: Path = INTERFACES) -> str:
    """IPv4 address of an interface that is up and has carrier. HindraxError with the reason and its remedy."""
    folder = interfaces / interface
    if not folder.exists():
        raise HindraxError(f"{interface}: no such interface; `ip link` lists them")
    try:
        carrier = (folder / "carrier").read_text(encoding="ascii").strip()
    except OSError as error:  # an interface that is down reports nothing at all
        raise HindraxError(f"{interface}: is down; `sudo ip link set {interface} up`") from error
    if carrier != "1":
        raise HindraxError(f"{interface}: no carrier; is the tether plugged in, and the other end powered?")
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as probe:
        try:
            answer = fcntl.ioctl(probe, SIOCGIFADDR, struct.pack(REQUEST, interface.encode()))
        except OSError as error:
            raise HindraxError(f"{interface}: no IPv4 address; give it one: docs/how-to/two-machines.md") from error
    return socket.inet_ntoa(answer[20:24])


def wait_for_address(tether: Tether, seconds: float, over: Callable[[], bool], report: Callable[[str], None]) -> str:
    """Wait until the interface of the tether has carrier and an address.

    Parameters
    ----------
    tether
        Whose interface is looked at, twice a second.
    seconds : [s]
        Longest wait; may be infinite.
    over
        Whether to give up without an error.
    report
        Is told why it still waits, once per reason.

    Returns
    -------
    str
        IPv4 address; empty when `over` became true.

    Raises
    ------
    HindraxError
        After `seconds`, with the last reason.
    """
    deadline, reported = time.monotonic() + seconds, ""
    while not over():
        try:
            return address_of(tether.interface)
        except HindraxError as error:
            if time.monotonic() > deadline:
                raise HindraxError(f"waited {seconds:.0f} s for the tether; {error}") from error
            if str(error) != reported:
                reported = str(error)
                report(f"waiting for the tether; {reported}")
        time.sleep(LOOK_S)
    return ""


def loopback_profile() -> Path:
    """Profile restricted to this machine."""
    return share_folder("config") / "loopback.xml"


def profile_file(tether: Tether | None) -> Path:
    """Profile to be used; one for a tether is written to the runtime folder of this user."""
    if tether is None:
        return loopback_profile()
    text = tether_profile(tether, loopback_profile().read_text(encoding="utf-8"))
    path = runtime_folder() / f"tether-{hashlib.sha256(text.encode()).hexdigest()[:12]}.xml"
    replace_text(path, text)
    return path


def tether_profile(tether: Tether, loopback: str) -> str:
    """Loopback profile extended to the tether."""
    ET.register_namespace("", SPACE)
    profile = ET.fromstring(loopback)  # noqa: S314  # our own file
    transport = _one(profile, "transport_descriptor")
    transport.remove(_one(transport, "interfaceWhiteList"))
    ET.SubElement(transport, _tag("maxInitialPeersRange")).text = str(PARTICIPANTS)
    allowed = ET.SubElement(ET.SubElement(transport, _tag("interfaces")), _tag("allowlist"))
    for name in ("lo", tether.interface):
        ET.SubElement(allowed, _tag("interface"), {"name": name, "netmask_filter": "ON"})
    again = _one(profile, "leaseAnnouncement")
    again.clear()
    ET.SubElement(again, _tag("sec")).text = ANNOUNCED_S
    if tether.peers:
        peers = ET.SubElement(_one(profile, "builtin"), _tag("initialPeersList"))
        for address in (GROUP, *tether.peers):
            place = ET.SubElement(ET.SubElement(peers, _tag("locator")), _tag("udpv4"))
            ET.SubElement(place, _tag("address")).text = address
    ET.indent(profile)
    return ET.tostring(profile, encoding="unicode")


def _tag(name: str) -> str:
    return f"{{{SPACE}}}{name}"


def _one(parent: ET.Element, name: str) -> ET.Element:
    found = parent.find(f".//{_tag(name)}")
    assert found is not None, name
    return found
