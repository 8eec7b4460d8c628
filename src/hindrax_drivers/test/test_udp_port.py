"""A device on the network: its datagrams are lines, and orders find it once it has spoken."""

import socket
from collections.abc import Iterator
from contextlib import closing

import pytest

from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Send
from hindrax_core.events import after
from hindrax_drivers.buses import line
from hindrax_drivers.buses.clock import SystemClock
from hindrax_drivers.buses.line import UdpPort, open_line

PATIENT_S = 10.0


class Talk:
    """A device at one end, the port at the other."""

    def __init__(self) -> None:
        self.clock = SystemClock()
        self.device = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.device.bind(("127.0.0.1", 0))
        self.device.settimeout(PATIENT_S)
        with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as free:
            free.bind(("127.0.0.1", 0))
            self.at = free.getsockname()
        self.path = f"udp://127.0.0.1:{self.at[1]}"
        opened = open_line(self.path, 115200, self.clock)
        assert isinstance(opened, UdpPort)
        self.line = opened

    def received(self) -> bytes:
        self.line.wait(after(self.clock.now(), PATIENT_S))
        return self.line.read()[0]


@pytest.fixture
def talk() -> Iterator[Talk]:
    one = Talk()
    yield one
    one.line.close()
    one.device.close()
    one.clock.close()


def test_every_datagram_is_whole_lines(talk: Talk) -> None:
    for sent, wanted in ((b"$DVPDL,1*00\r\n", b"$DVPDL,1*00\r\n"), (b"$DVPDL,2*00", b"$DVPDL,2*00\n")):
        talk.device.sendto(sent, talk.at)
        assert talk.received() == wanted
    assert talk.line.read()[0] == b""


def test_orders_wait_until_it_is_known_where_the_device_is(talk: Talk) -> None:
    for number in range(20):
        talk.line.send(Send(b"CONFIGURATION %d\n" % number))
    talk.device.sendto(b"hello\n", talk.at)
    assert talk.received() == b"hello\n"
    talk.line.send(Send(b"SEND-DVPDL ON\n"))
    orders: list[bytes] = []
    while not orders or orders[-1] != b"SEND-DVPDL ON\n":
        orders.append(talk.device.recv(100))
    assert orders == [b"CONFIGURATION %d\n" % number for number in range(11, 20)] + [b"SEND-DVPDL ON\n"]


def test_of_two_devices_at_one_port_only_the_first_is_heard_and_ordered_about_while_it_speaks(
    talk: Talk, monkeypatch: pytest.MonkeyPatch
) -> None:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as other:
        other.bind(("127.0.0.1", 0))
        other.settimeout(PATIENT_S)
        talk.device.sendto(b"one\n", talk.at)
        assert talk.received() == b"one\n"
        other.sendto(b"other\n", talk.at)
        talk.device.sendto(b"one again\n", talk.at)
        found = b""
        while b"again" not in found:
            found += talk.received()
        assert found == b"one again\n"
        other.sendto(b"other\n", talk.at)
        assert talk.received() == b""
        talk.line.send(Send(b"to the first"))
        assert talk.device.recv(100) == b"to the first"
        monkeypatch.setattr(line, "OWN_S", 0.0)
        other.sendto(b"the first is silent\n", talk.at)
        assert talk.received() == b"the first is silent\n"
        talk.line.send(Send(b"to the other"))
        assert other.recv(100) == b"to the other"


def test_an_address_that_is_taken_or_none_is_one_sentence(talk: Talk) -> None:
    for path, wanted in (
        (talk.path, "cannot listen there .*in use"),
        ("udp://192.0.2.1:27000", "cannot listen there"),
        ("udp://27000", "wanted udp://ADDRESS:PORT"),
        ("udp://0.0.0.0:99999", "wanted udp://ADDRESS:PORT"),
    ):
        with pytest.raises(DeviceError, match=wanted):
            open_line(path, 115200, talk.clock)


def test_a_line_that_was_closed_is_lost(talk: Talk) -> None:
    talk.line.close()
    with pytest.raises(DeviceError, match="lost"):
        talk.line.read()
