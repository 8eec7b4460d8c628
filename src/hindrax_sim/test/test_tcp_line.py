"""A Water Linked DVL at its TCP port: the driver connects, several clients are served, and losses are noticed."""

import json
import socket
from collections.abc import Iterator
from contextlib import closing

import pytest

from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Identity, Send
from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.readings import BottomVelocity
from hindrax_drivers.buses.clock import SystemClock
from hindrax_drivers.buses.line import TcpPort, open_line
from hindrax_drivers.devices import a50
from hindrax_sim.buses.serial_ends import HERE, TcpEnd
from hindrax_sim.devices.a50 import A50


class Wired:
    """A DVL at a free port of this machine; `run` lets its time pass and gives what a client receives."""

    def __init__(self) -> None:
        with socket.create_server((HERE, 0)) as spare:
            self.number = spare.getsockname()[1]
        self.device, self.end, self.now_s = A50(), TcpEnd(self.number), 0.0

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.01)):
            self.now_s += 0.01
            self.end.write(self.device.step(self.now_s) + self.device.receive(self.end.read(), self.now_s))


@pytest.fixture
def wired() -> Iterator[Wired]:
    one = Wired()
    yield one
    one.end.close()


def arrived(line: TcpPort, clock: SystemClock) -> bytes:
    """Bytes on the line; over loopback they are there soon."""
    line.wait(stamp_from_s(clock.now() * 1e-9 + 1.0))
    return line.read()[0]


@pytest.mark.parametrize("form", ["tcp://{}:{}", "tcp:{}:{}"])
def test_the_driver_connects_sets_it_up_and_measures(wired: Wired, form: str) -> None:
    driver = a50.A50()
    with closing(SystemClock()) as clock, closing(open_line(form.format(HERE, wired.number), 0, clock)) as line:
        assert isinstance(line, TcpPort)
        found = list(driver.start(clock.now()))
        for _ in range(20):
            for one in found:
                if isinstance(one, Send):
                    line.send(one)
            wired.run(0.1)
            found = [one for one in found if not isinstance(one, Send)]
            found += driver.feed(arrived(line, clock), clock.now())
    assert [one.text for one in found if isinstance(one, Identity)] == ["Water Linked DVL, json_v3.1"]
    assert wired.device.settings.speed_of_sound == 1484
    assert sum(isinstance(one, Stamped) and isinstance(one.reading, BottomVelocity) for one in found) > 5


def test_every_client_is_served_and_one_that_leaves_harms_none(wired: Wired) -> None:
    first, second = (socket.create_connection((HERE, wired.number)) for _ in range(2))
    with first, second:
        wired.run(0.5)
        first.close()
        wired.run(0.5)
        lines = second.recv(1 << 16).split(b"\r\n")
    kinds = {json.loads(line)["type"] for line in lines[:-1]}
    assert kinds == {"velocity", "position_local"}


def test_a_device_that_closes_the_connection_is_lost_and_one_that_is_not_there_is_named(wired: Wired) -> None:
    with closing(SystemClock()) as clock:
        line = TcpPort(f"tcp://{HERE}:{wired.number}", clock)
        wired.run(0.1)
        wired.end.plug(in_place=False)
        with pytest.raises(DeviceError, match=r"lost .the device has closed the connection.; check network and power"):
            [arrived(line, clock) for _ in range(100)]
        with pytest.raises(DeviceError, match=r"cannot connect .*; check power and network of the device"):
            open_line(f"tcp://{HERE}:{wired.number}", 0, clock)


@pytest.mark.parametrize("address", ["tcp://here", "tcp://:16171", "tcp://here:0", "tcp://here:99999", "tcp:16171"])
def test_an_address_that_is_none_is_refused(address: str) -> None:
    with closing(SystemClock()) as clock, pytest.raises(DeviceError, match="wanted tcp://HOST:PORT"):
        open_line(address, 0, clock)


@pytest.mark.parametrize("end", [b"\n", b"\r\n", b""], ids=["LF", "CR LF", "none"])
def test_commands_are_taken_however_they_end(wired: Wired, end: bytes) -> None:
    """One public client ends no command with a line; another writes two at once."""
    asked = b'{"command": "get_config"}' + end
    answers = wired.device.receive(asked[:9], 0.0) + wired.device.receive(asked[9:] + asked, 0.0)
    assert [json.loads(line)["response_to"] for line in answers.splitlines()] == ["get_config"] * 2
    assert wired.device.receive(b"no order" + end, 0.0) == b""
    wanted = b'{"command": "set_config", "parameters": {"speed_of_sound": 1480}}' + end
    (answer,) = wired.device.receive(b"\n" + wanted, 0.0).splitlines()
    assert json.loads(answer)["success"]
    assert wired.device.settings.speed_of_sound == 1480
