"""A ROS domain that no process on this machine uses, for a stack or a test of its own."""

import contextlib
import socket
from collections.abc import Iterator
from pathlib import Path

from hindrax_core.errors import HindraxError

DOMAINS = range(1, 101)
DOMAIN_ADDRESS = "\0hindrax-domain-{}"
"""Abstract socket that a tool binds while it uses a domain (unix(7)): no file, so nothing that a link could lead to."""
FIRST_PORT, PORTS_PER_DOMAIN = 7400, 250
"""UDP ports at which the participants of a domain receive (OMG DDSI-RTPS 2.3, section 9.6.1.1)."""
SOCKET_TABLES = (Path("/proc/net/udp"), Path("/proc/net/udp6"))


def occupied_domains(tables: tuple[Path, ...] = SOCKET_TABLES) -> set[int]:
    """Domains in which a process of this machine receives. Instant; a port of another program only costs a domain."""
    lines = (line for table in tables if table.is_file() for line in table.read_text(encoding="ascii").splitlines()[1:])
    # The second column of a table of the kernel (proc(5)), address:port in hexadecimal digits.
    ports = (int(line.split()[1].rpartition(":")[2], 16) for line in lines)
    return {(port - FIRST_PORT) // PORTS_PER_DOMAIN for port in ports if port >= FIRST_PORT}


@contextlib.contextmanager
def free_domain() -> Iterator[int]:
    """Reserve a domain that nobody uses, until the end of the block. HindraxError when there is none."""
    for number in DOMAINS:
        with contextlib.closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as lock:
            try:
                lock.bind(DOMAIN_ADDRESS.format(number))
            except OSError:  # another tool uses it
                continue
            if number not in occupied_domains():  # processes of a killed tool live on without its lock
                yield number
                return
    raise HindraxError(
        f"ROS domains {DOMAINS[0]} to {DOMAINS[-1]}: found all in use, wanted a free one; wait for a mock run to end"
    )
