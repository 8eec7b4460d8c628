"""A ROS domain that no process on this machine uses, for a stack or a test of its own."""

import contextlib
import hashlib
import socket
from collections.abc import Iterator
from pathlib import Path

from hindrax_core.errors import HindraxError

DOMAINS = range(1, 101)
DOMAIN_ADDRESS = "\0hindrax-domain-{}"
"""Abstract socket that a tool binds while it uses a domain (unix(7)): no file, so nothing that a link could lead to."""
FIRST_PORT, PORTS_PER_DOMAIN = 7400, 250
"""UDP ports at which the participants of a domain receive (OMG DDSI-RTPS 2.3, section 9.6.1.1)."""
STACK_ADDRESS = "\0hindrax-stack-{}"
"""The same of a stack; its name has one length for every namespace."""
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


@contextlib.contextmanager
def only_stack(domain: int, namespace: str) -> Iterator[None]:
    """Be the only stack of this machine in a namespace of a domain until the end of the block.

    Two of them would obey, arm and disarm each other's operators, whatever vehicles they have. The kernel takes the
    reservation back when the tool ends, however it ends.

    Parameters
    ----------
    domain
        ROS domain.
    namespace
        Of the nodes.

    Yields
    ------
    None
        While it is reserved.

    Raises
    ------
    HindraxError
        Where another stack has both.
    """
    name = hashlib.sha256(f"{domain} {namespace}".encode()).hexdigest()
    with contextlib.closing(socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)) as lock:
        try:
            lock.bind(STACK_ADDRESS.format(name))
        except OSError as error:
            raise HindraxError(
                f"ROS domain {domain}: found another stack in {namespace} on this machine, wanted none; end that one "
                "(`./hindrax status` lists it), or give this one a graph of its own: another ROS_DOMAIN_ID, in this "
                "terminal and in all that command it"
            ) from error
        yield
