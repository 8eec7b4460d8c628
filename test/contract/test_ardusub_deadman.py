"""The dead man of an ArduSub: what it does on the line when the process that had armed it is dead or frozen."""

import contextlib
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.nodes.deadman import NeutralWriter
from hindrax_drivers.nodes.thruster_settings import Settings
from hindrax_sim.devices.ardupilot import firmware
from hindrax_sim.devices.ardupilot.wire import frame

HEAVY = load_vehicle(Path(__file__).parents[2] / "src/hindrax_bringup/vehicles/bluerov2-heavy.yaml")
NEUTRAL = (1500.0,) * 8


class Flying:
    """An autopilot that was armed and driven by sticks, on the loopback, sending to a port."""

    def __init__(self, to_port: int) -> None:
        self.board = firmware.ArduSub(HEAVY.thrusters, now_s=0.0)
        self.now_s = 0.0
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setblocking(False)
        self.socket.connect(("127.0.0.1", to_port))
        self.by_station(76, 36.0, 20_000.0, *(0.0,) * 5, 511, 1, 1, 0)
        self.by_station(76, 1.0, *(0.0,) * 6, 400, 1, 1, 0)
        self.by_station(69, 800, 0, 500, 0, 0, 1, 0, 0, 0, 0, *(0,) * 6)
        self.step(0.05)
        assert self.board.armed
        assert self.wire() != NEUTRAL

    def by_station(self, number: int, *values: float | bytes) -> None:
        self.board.receive(frame(number, values, 0, 255, 191), self.now_s)

    def wire(self) -> tuple[float | None, ...]:
        return self.board.pulses_us()[:8]

    def step(self, seconds: float) -> None:
        received = b""
        with contextlib.suppress(OSError):  # no more of it
            while True:
                received += self.socket.recv(4096)
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            self.now_s += 0.005
            data = self.board.receive(received, self.now_s) + self.board.step(self.now_s)
            received = b""
            if data:
                self.send(data)

    def send(self, data: bytes) -> None:
        with contextlib.suppress(OSError):  # nobody listens
            self.socket.send(data)


@pytest.fixture
def port() -> int:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@pytest.fixture
def flying(port: int) -> Iterator[Flying]:
    made = Flying(port)
    yield made
    made.socket.close()


@pytest.fixture
def writer(port: int) -> Iterator[NeutralWriter]:
    vehicle = replace(HEAVY, output=replace(HEAVY.output, device="ardusub", port=f"udpin:127.0.0.1:{port}"))
    made = NeutralWriter(Settings(vehicle, vehicle.output.port))
    yield made
    made.close()


def until(flying: Flying, writer: NeutralWriter, done: Callable[[], bool], within_s: float) -> float:
    """Seconds of the autopilot until something is so, with a look of the dead man every tenth of one."""
    begin_s = flying.now_s
    while not done():
        assert flying.now_s - begin_s < within_s
        flying.step(0.09)
        writer.write()
        time.sleep(0.002)  # a datagram needs a moment
    return flying.now_s - begin_s


def test_what_the_dead_process_had_armed_is_neutral_within_half_a_second_and_disarmed(
    flying: Flying, writer: NeutralWriter
) -> None:
    writer.armed = True
    assert until(flying, writer, lambda: flying.wire() == NEUTRAL, 0.5) < 0.5
    assert not flying.board.armed
    until(flying, writer, lambda: not writer.armed, 1.5)
    assert writer.trouble == ""
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as again:
        again.bind(("127.0.0.1", flying.socket.getpeername()[1]))  # the line is free for the next node


def test_what_it_had_not_armed_is_left_to_who_has(flying: Flying, writer: NeutralWriter) -> None:
    before = flying.wire()
    for _ in range(5):
        writer.write()
        flying.step(0.09)
    assert flying.board.armed
    assert flying.wire() == before


def test_a_frozen_process_that_holds_the_line_is_told(flying: Flying, writer: NeutralWriter, port: int) -> None:
    with closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as frozen:
        frozen.bind(("127.0.0.1", port))
        writer.write()
        assert not writer.blocked, "it was never armed"
        writer.armed = True
        writer.write()
        assert writer.blocked
    until(flying, writer, lambda: flying.wire() == NEUTRAL, 0.5)
    assert not writer.blocked
