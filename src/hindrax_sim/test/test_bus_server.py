"""Client and server of the virtual bus: transactions, errors, and the clock that jumps while everybody sleeps."""

import errno
import itertools
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace

import pytest

from hindrax_core.bus_operations import DeviceError, Read, Write, WriteRead
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.buses import mock_protocol
from hindrax_drivers.buses.mock_bus import VirtualBus
from hindrax_drivers.buses.ports import open_bus, open_clock
from hindrax_sim import mock_vehicle
from hindrax_sim.buses.mock_server import BusServer
from hindrax_sim.buses.virtual_i2c import VirtualI2c
from hindrax_sim.hardware import Hardware
from hindrax_sim.mock_vehicle import MockVehicle
from hindrax_sim.testing.lock_step import LoggedI2c


class Echo:
    """Remembers what was written, and when, and reads it back padded."""

    def __init__(self) -> None:
        self.last, self.at_s = b"", 0.0

    def write(self, data: bytes, now_s: float) -> None:
        self.last, self.at_s = data, now_s

    def read(self, count: int, now_s: float) -> bytes:
        assert now_s >= self.at_s
        return self.last[:count].ljust(count, b"\xee")


class World:
    """A mock that serves in a thread and advances as its clients allow."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.bus = LoggedI2c()
        self.bus.attach(0x42, Echo())
        self.server = BusServer(path, self.bus.transfer, Stamp(1_000))
        self.now = Stamp(1_000)
        self._stop = threading.Event()
        self.jumps: list[Stamp] = []
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.is_set():
            self.server.serve(self.now, 0.002)
            if not self.server.busy() and self.server.earliest_wakeup() < 1 << 62:
                self.now = max(self.now, self.server.earliest_wakeup())
                self.jumps.append(self.now)

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.server.close()


@pytest.fixture
def world(tmp_path: Path) -> Iterator[World]:
    one = World(str(tmp_path / "bus"))
    yield one
    one.close()


@pytest.fixture
def bus(world: World) -> Iterator[VirtualBus]:
    one = open_bus(f"mock:{world.path}", "test")
    assert isinstance(one, VirtualBus)
    yield one
    one.close()


def test_transactions_reach_the_emulator_and_the_log(world: World, bus: VirtualBus) -> None:
    assert bus.transfer(Write(0x42, b"abc")) == b""
    assert bus.transfer(Read(0x42, 5)) == b"abc\xee\xee"
    assert bus.transfer(WriteRead(0x42, b"xy", 2)) == b"xy"
    assert bus.transfer(Write(0x42, b"")) == b""
    assert [transaction for _, transaction, _ in world.bus.log] == [
        Write(0x42, b"abc"),
        Read(0x42, 5),
        WriteRead(0x42, b"xy", 2),
        Write(0x42, b""),
    ]


def test_a_long_transfer_goes_through_in_one_piece(bus: VirtualBus) -> None:
    long = bytes(range(256)) * 16
    assert bus.transfer(WriteRead(0x42, long, len(long))) == long


def test_a_missing_device_is_reported_with_port_address_and_errno(bus: VirtualBus) -> None:
    with pytest.raises(DeviceError, match=r"mock:.*/bus address 0x43: no acknowledge.*EREMOTEIO, 121"):
        bus.transfer(Read(0x43, 1))


def test_time_jumps_to_the_sleeper_and_stands_still_while_it_works(world: World, bus: VirtualBus) -> None:
    assert bus.now() == 1_000
    hour = Stamp(1_000 + 3_600_000_000_000)
    bus.sleep_until(hour)
    assert bus.now() == hour
    time.sleep(0.02)
    assert bus.now() == hour
    bus.sleep_until(Stamp(5))  # long past: returns without a word to the mock
    assert world.jumps == [hour]


def test_an_awake_client_holds_the_time_and_others_can_change_their_mind(world: World) -> None:
    holder, lazy = (open_clock(f"mock:{world.path}", name) for name in ("holder", "lazy"))
    holder.sleep_until(Stamp(2_000))
    threading.Timer(0.02, lazy.wake).start()
    lazy.sleep_until(Stamp(10**15))
    assert lazy.now() == 2_000
    lazy.wake()  # nobody sleeps: the next sleep ends at once
    lazy.sleep_until(Stamp(10**15))
    assert lazy.now() == 2_000
    holder.close()  # who hangs up holds nobody
    lazy.sleep_until(Stamp(10**15))
    assert lazy.now() == 10**15
    lazy.close()


def test_whose_sleep_is_cut_short_is_served_and_sleeps_again(world: World, bus: VirtualBus) -> None:
    holder = open_clock(f"mock:{world.path}", "holder")
    holder.sleep_until(Stamp(2_000))
    for byte in range(3):
        for _ in range(byte + 1):
            bus.wake()
            bus.sleep_until(Stamp(10**15))
        bus.transfer(Write(0x42, bytes([byte])))
        assert bus.transfer(Read(0x42, 2)) == bytes([byte, 0xEE])
    bus.wake()
    bus.sleep_until(Stamp(10**15))
    assert bus.now() == 2_000
    threading.Timer(0.05, holder.close).start()
    bus.sleep_until(Stamp(10**15))  # the answer to the sleep before does not end this one
    assert bus.now() == 10**15


def test_a_client_is_roused_by_name(tmp_path: Path) -> None:
    with closing(BusServer(str(tmp_path / "bus"), VirtualI2c().transfer)) as server:
        done: list[Stamp] = []

        def nap() -> None:
            clock = open_clock(f"mock:{tmp_path}/bus", "dvl75")
            clock.sleep_until(Stamp(500))
            done.append(clock.now())

        sleeper = threading.Thread(target=nap)
        sleeper.start()
        _serve_until(server, lambda: server.earliest_wakeup() == 500)
        server.serve(Stamp(7))
        server.wake("somebody else")
        assert server.earliest_wakeup() == 500
        server.wake("dvl75")
        assert server.busy() == ["dvl75"]
        sleeper.join()
        assert done == [7]


def test_a_frozen_client_holds_up_the_steps_of_a_mock_only_for_a_while(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, vehicle: Vehicle
) -> None:
    ticks = itertools.count()
    monkeypatch.setattr(mock_vehicle, "time", SimpleNamespace(monotonic=lambda: 0.04 * next(ticks)))
    frozen = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with MockVehicle(Hardware(vehicle, 1), tmp_path, rate=0.0) as mock, frozen:
        frozen.connect(mock.clock.removeprefix("mock:"))
        frozen.send(mock_protocol.hello("control"))
        held = []
        for _ in range(2):
            frozen.send(mock_protocol.sleep(mock.hardware.stamp))
            _step_until(mock, lambda: bool(mock.held_up_by))
            held.append(mock.held_up_by)
            _step_until(mock, lambda: not mock.held_up_by)
        assert held == [["control"]] * 2


def _step_until(mock: MockVehicle, condition: Callable[[], bool]) -> None:
    for _ in range(1000):
        if condition():
            return
        mock.step()
    raise AssertionError("never came true")


def _serve_until(server: BusServer, condition: Callable[[], bool]) -> None:
    for _ in range(1000):
        if condition():
            return
        server.serve(Stamp(0), 0.01)
    raise AssertionError("never came true")


def test_a_readable_port_ends_a_sleep(world: World) -> None:
    holder, serial = (open_clock(f"mock:{world.path}", name) for name in ("holder", "serial"))
    holder.sleep_until(Stamp(2_000))
    here, there = os.pipe()
    os.write(there, b"$")
    serial.sleep_until(Stamp(10**15), readable=here)
    assert serial.now() == 2_000
    os.close(here)
    os.close(there)
    holder.close()
    serial.close()


def test_without_a_mock_the_remedy_is_named(tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match=r"no mock hardware answers.*hindrax mock"):
        open_bus(f"mock:{tmp_path}/nobody")


def test_a_mock_that_dies_is_a_device_error_and_may_come_back(tmp_path: Path) -> None:
    path = str(tmp_path / "bus")
    first = World(path)
    bus = open_bus(f"mock:{path}")
    first.close()
    with pytest.raises(DeviceError, match="has gone"):
        bus.transfer(Read(0x42, 1))
    second = World(path)
    assert bus.transfer(Read(0x42, 1)) == b"\xee"
    bus.close()
    second.close()


def test_a_client_that_talks_nonsense_is_dropped_and_others_live(world: World, bus: VirtualBus) -> None:
    rude = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    rude.connect(world.path)
    rude.sendall(b"\xff" * 64)
    assert rude.recv(10) == b""
    assert bus.transfer(Read(0x42, 1)) == b"\xee"
    rude.close()


def test_what_is_to_be_done_meanwhile_is_done_once_at_the_beginning(world: World, bus: VirtualBus) -> None:
    seen: list[Stamp] = []
    bus.sleep_until(Stamp(5), meanwhile=lambda: seen.append(bus.now()))  # long past
    bus.sleep_until(Stamp(2_000), meanwhile=lambda: seen.append(Stamp(0)))
    assert seen == [Stamp(1_000), Stamp(0)]
    world.close()
    bus.sleep_until(Stamp(10**15), meanwhile=lambda: seen.append(Stamp(1)))
    assert seen[2:] == [Stamp(1)], "that the mock has gone must still be told"


def test_without_room_for_the_page_of_the_time_it_is_given_instead_of_a_bus_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, vehicle: Vehicle
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    with pytest.raises(HindraxError, match=r"bus\.time: cannot be made \(No space left on device\); make room"):
        BusServer(str(tmp_path / "bus"), VirtualI2c().transfer)
    # Nor is a port left behind, which would be the next terminal's.
    with pytest.raises(HindraxError, match=r"i2c\.time: cannot be made \(No space left on device\); make room"):
        MockVehicle(Hardware(vehicle, 1), tmp_path, rate=0.0)
    assert list(tmp_path.iterdir()) == []
