"""Access checks: the right host, the right origin, the right token. Pure; the sentences are for the refused client."""

import hmac
import ipaddress
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus

from hindrax_core.errors import UsageError

BEARER = "Bearer "
HOST = re.compile(r"(?:\[([0-9a-f:.]+)\]|([0-9a-z.-]+))(?::[0-9]{1,5})?", re.IGNORECASE)


class RefusedRequest(Exception):  # noqa: N818  # an answer to a browser, not a fault of ours
    """A request that is not served: status and one sentence."""

    def __init__(self, status: HTTPStatus, sentence: str) -> None:
        super().__init__(sentence)
        self.status, self.sentence = status, sentence


@dataclass(frozen=True, slots=True)
class Access:
    """Requirements of a request: one of these host names, or any address in numbers where `numeric`; and the token."""

    hosts: frozenset[str]
    token: str
    numeric: bool = False

    def check_place(self, hosts: Sequence[str], origins: Sequence[str]) -> None:
        """Raise RefusedRequest for a strange Origin, or Host (a foreign name that resolves to us: DNS rebinding)."""
        name = hostname(hosts[0]) if len(hosts) == 1 else ""
        if name not in self.hosts and not (self.numeric and is_numeric(name)):
            found = ", ".join(hosts) or "none"
            wanted = " or ".join([*sorted(self.hosts), *(["an address in numbers"] if self.numeric else [])])
            raise RefusedRequest(HTTPStatus.MISDIRECTED_REQUEST, f"Host: found {found}, wanted {wanted}")
        if origins and list(origins) != [f"http://{hosts[0]}"]:
            raise RefusedRequest(HTTPStatus.FORBIDDEN, "Origin: found another page, wanted the one that is served here")

    def check_token(self, authorization: str | None) -> None:
        """Raise RefusedRequest for a request without the token, compared in constant time."""
        given = (authorization or "").removeprefix(BEARER)
        if not hmac.compare_digest(given.encode(), self.token.encode()):
            wrong = "token: missing or wrong; open the address that `./hindrax web` printed"
            raise RefusedRequest(HTTPStatus.UNAUTHORIZED, wrong)


def hostname(host: str) -> str:
    """Name in a Host header in lower case, without port and brackets; empty when invalid."""
    found = HOST.fullmatch(host)
    return (found[1] or found[2]).lower() if found else ""


def hosts_of(address: str) -> frozenset[str]:
    """Names by which a browser may call a server at this address; UsageError for one that means every address."""
    try:
        found = ipaddress.ip_address(address)
    except ValueError:
        raise UsageError(
            f"--address: found {address!r}, wanted an address in numbers, such as 192.168.2.2; `ip address` lists yours"
        ) from None
    if found.is_unspecified:
        raise UsageError(f"--address: {address} means every interface, wanted the address of one, such as the tether's")
    return frozenset({str(found)} | ({"localhost"} if found.is_loopback else set()))


def is_numeric(host: str) -> bool:
    """Whether a host is an address, which no foreign name server can have given to a browser."""
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def is_loopback(host: str) -> bool:
    """Whether a host, by address or name, is reached from its own machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def called_hosts(address: str, names: Sequence[str]) -> frozenset[str]:
    """Names by which a browser may call a server at this address.

    Parameters
    ----------
    address
        Which it listens at; with names it may mean every interface, as in a container.
    names
        Of this host, without a port; empty: only the address itself.

    Returns
    -------
    frozenset[str]
        In lower case.

    Raises
    ------
    UsageError
        For a name that is none.
    """
    for name in names:
        if not hostname(name) or hostname(name) != name.lower():
            raise UsageError(f"--host: found {name!r}, wanted a name or address without a port, such as blueos.local")
    return frozenset(map(hostname, names)) or hosts_of(address)


def granted(address: str, names: Sequence[str], token: str) -> Access:
    """Return what a server asks of a request.

    With names it listens in a container, and who asks names the address of its host: a browser whichever it has found,
    BlueOS 127.0.0.1.

    Parameters
    ----------
    address, names
        As of `called_hosts`.
    token
        Which every order must have.

    Returns
    -------
    Access
        With names, any address in numbers will do as well.
    """
    return Access(called_hosts(address, names), token, numeric=bool(names))


def security_headers(script_hash: str) -> Mapping[str, str]:
    """Headers of every answer. The style is open because a report brings its own; a report's script never runs."""
    policy = (
        f"default-src 'none'; script-src 'sha256-{script_hash}'; style-src 'unsafe-inline'; img-src data: blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
    return {
        "Content-Security-Policy": policy,
        "Cache-Control": "no-store",
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "DENY",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cross-Origin-Resource-Policy": "same-origin",
    }
