"""A DVL on the network, as programs that listen at its Ethernet port know it."""

import socket
from collections.abc import Iterator

import pytest

from hindrax_core.errors import HindraxError
from hindrax_sim.buses.serial_ends import HERE, UdpEnd
from hindrax_sim.devices.dvl75 import Dvl75


class Wired:
    """A DVL on the network, and a program at the other end of it."""

    def __init__(self) -> None:
        self.device = Dvl75()
        self.program = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.program.bind((HERE, 0))
        self.program.setblocking(False)
        spare = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        spare.bind((HERE, 0))
        self.at = spare.getsockname()
        spare.close()
        self.port = UdpEnd(self.program.getsockname()[1], self.at[1])
        self.now_s = 0.0

    def run(self, seconds: float) -> list[bytes]:
        """Datagrams of a time."""
        received = []
        for _ in range(round(seconds / 0.01)):
            self.now_s += 0.01
            self.port.write(self.device.step(self.now_s) + self.device.receive(self.port.read(), self.now_s))
            while True:
                try:
                    received.append(self.program.recv(2048))
                except BlockingIOError:
                    break
        return received

    def close(self) -> None:
        self.program.close()
        self.port.close()


@pytest.fixture
def wired() -> Iterator[Wired]:
    one = Wired()
    yield one
    one.close()


def test_every_sentence_is_a_datagram_and_commands_come_through(wired: Wired) -> None:
    before = wired.run(1.5)
    assert len(before) > 5
    assert all(one.startswith(b"$DVEXT,") and one.endswith(b"\r\n") and one.count(b"$") == 1 for one in before)
    wired.program.sendto(b"SEND-DVPDL ON\n", wired.at)
    kinds = {one.split(b",")[0] for one in wired.run(1.0)}
    assert kinds == {b"$DVEXT", b"$DVPDL"}


def test_a_program_that_does_not_listen_disturbs_nobody(wired: Wired) -> None:
    wired.run(0.5)
    wired.program.close()
    wired.program = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wired.program.setblocking(False)
    wired.run(0.5)


def test_it_comes_back_with_a_port_that_was_unplugged(wired: Wired) -> None:
    assert wired.run(1.0)
    wired.port.plug(in_place=False)
    assert not wired.run(0.3)
    wired.port.plug(in_place=True)
    assert wired.run(1.0)


def test_a_port_that_is_taken_is_named(wired: Wired) -> None:
    with pytest.raises(HindraxError, match=f"udp {wired.at[1]} for .*in use; another mock may have it"):
        UdpEnd(27000, wired.at[1])
