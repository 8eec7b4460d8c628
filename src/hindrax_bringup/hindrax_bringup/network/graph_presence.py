"""Who lives in a ROS domain of this machine: lock files tell only of stacks whose tool still runs."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

from hindrax_core.errors import HindraxError

FIRST_PORT, PORTS_PER_DOMAIN = 7400, 250
"""UDP ports at which the participants of a domain receive (OMG DDSI-RTPS 2.3, section 9.6.1.1)."""
SOCKET_TABLES = (Path("/proc/net/udp"), Path("/proc/net/udp6"))
LOOK_AT_MOST_S = 20.0
"""Longest time for the process that looks, on a busy machine."""


def occupied_domains(tables: tuple[Path, ...] = SOCKET_TABLES) -> set[int]:
    """Domains in which a process of this machine receives. Instant; a port of another program only costs a domain."""
    ports = (port for table in tables if table.is_file() for port in _local_ports(table.read_text(encoding="ascii")))
    return {(port - FIRST_PORT) // PORTS_PER_DOMAIN for port in ports if port >= FIRST_PORT}


def _local_ports(table: str) -> Iterator[int]:
    """Port of each socket in a table of the kernel (proc(5)): the second column, address:port in hexadecimal digits."""
    for line in table.splitlines()[1:]:
        yield int(line.split()[1].rpartition(":")[2], 16)


def require_no_stack(domain: int, namespace: str, environment: Mapping[str, str]) -> None:
    """HindraxError when nodes of a stack of this namespace are in this domain; other nodes may be there."""
    if domain not in occupied_domains():
        return
    words = [sys.executable, "-m", "hindrax_bringup.nodes.stack_search", namespace]
    # A process of its own: the middleware keeps the profile of the first node for as long as its process lives.
    try:
        done = subprocess.run(  # noqa: S603  # our own module
            words, env=dict(environment), capture_output=True, text=True, timeout=LOOK_AT_MOST_S, check=True
        )
    except subprocess.SubprocessError as error:
        raise HindraxError(f"ROS domain {domain}: cannot be searched for a stack ({error}); try again") from error
    found = json.loads(done.stdout)
    if found:
        raise HindraxError(
            f"ROS domain {domain}: found the nodes {', '.join(found)} of a stack, wanted none; "
            "end that stack, or unset ROS_DOMAIN_ID for a free domain"
        )
