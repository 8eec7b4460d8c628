"""The tether: the one network interface, besides loopback, over which the ROS graph may reach another machine.

It is named by `--tether` or by HINDRAX_TETHER as `IFACE` or `IFACE:PEER,PEER`: `eth0:192.168.2.1`. A middleware that
starts before the interface has carrier and address never discovers anybody there, so whoever starts one waits first.
"""

from __future__ import annotations

import argparse
import fcntl
import ipaddress
import os
import re
import socket
import struct
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_fitted

SETTING = "HINDRAX_TETHER"
INTERFACES = Path("/sys/class/net")
SIOCGIFADDR = 0x8915
REQUEST = "16s16x"
"""`struct ifreq` (netdevice(7)): name, then a socket address."""
LOOK_S = 0.5
FOREVER_S = float("inf")


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
    if not re.fullmatch(r"[\w.-]{1,15}", interface, re.ASCII) or interface == "lo":
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


class _IntoSetting(argparse.Action):
    """The option sets the environment variable, so that child processes inherit it."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[object] | None,
        option_string: str | None = None,
    ) -> None:
        try:
            parse_tether(str(values))
        except UsageError as error:
            parser.error(f"{option_string}: {error}")
        os.environ[SETTING] = str(values)
        setattr(namespace, self.dest, values)


def add_tether(parser: argparse.ArgumentParser) -> None:
    """Which interface leads to the other machine."""
    parser.add_argument(
        "--tether",
        action=_IntoSetting,
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
    """Return the tether's address once it has carrier; empty when `over` became true. HindraxError after `seconds`."""
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


def main() -> int:
    """Wait for the tether that this terminal names, for launch files."""
    tether = tether_setting()
    if tether is not None:
        wait_for_address(tether, FOREVER_S, lambda: False, lambda sentence: print_fitted(sentence, sys.stderr))
    return 0


if __name__ == "__main__":
    sys.exit(main())
