"""The middleware profile: loopback, plus the tether's interface if one is named.

Addresses alone do not keep strangers out: Linux delivers a datagram for any of its addresses, whichever interface it
came in by, and the answer is routed wherever the stranger is. With the netmask filter a participant speaks only to
those who are in the network of an allowed interface, so a stranger elsewhere is never answered and never matched.
"""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ET
from pathlib import Path

from hindrax_bringup.network.tether import Tether
from hindrax_bringup.share_files import share_folder
from hindrax_bringup.stack_lock import runtime_folder

SPACE = "http://www.eprosima.com"
GROUP = "239.255.0.1"
"""Ports at which participants announce themselves (OMG DDSI-RTPS 2.3, section 9.6.1.4.1); allowed interfaces only."""
PARTICIPANTS = 32
"""Ports tried per peer: one for each participant on its machine."""


def loopback_profile() -> Path:
    """Profile restricted to this machine."""
    return share_folder("config") / "loopback.xml"


def profile_file(tether: Tether | None) -> Path:
    """Profile to be used; one for a tether is written to the runtime folder of this user."""
    if tether is None:
        return loopback_profile()
    text = tether_profile(tether, loopback_profile().read_text(encoding="utf-8"))
    path = runtime_folder() / f"tether-{hashlib.sha256(text.encode()).hexdigest()[:12]}.xml"
    draft = path.with_suffix(".draft")
    draft.write_text(text, encoding="utf-8")
    draft.rename(path)
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
