"""The host of a schedule: delivers, serves requests at once, stops clean, and does not hide our own mistakes."""

import os
import queue
import signal
from collections.abc import Sequence

import pytest

from hindrax_core.bus_operations import Pause, Program, Read, Transaction, Write
from hindrax_core.driver_interface import Identity
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.readings import Battery, Reading
from hindrax_drivers.buses.bus_schedule import BusSchedule
from hindrax_drivers.buses.clock import SystemClock
from hindrax_drivers.buses.port_threads import BusThread, Deliver


class SystemWire(SystemClock):
    """A bus in system time whose devices answer with zeros."""

    closed = False

    def transfer(self, transaction: Transaction) -> bytes:
        return b"" if isinstance(transaction, Write) else bytes(transaction.count)

    def close(self) -> None:
        self.closed = True
        super().close()


class Meter:
    period_s = 0.002

    def configure(self) -> Program[Identity]:
        yield Write(1, b"\x00")
        return Identity("meter")

    def cycle(self, stamp: Stamp) -> Program[Sequence[Stamped[Reading] | Rejected]]:
        yield Pause(0.001)
        yield Read(1, 2)
        return [Stamped(stamp, Battery(1.0))]


Received = queue.SimpleQueue[tuple[str, object]]


def into(received: Received) -> Deliver:
    def deliver(name: str, outputs: Sequence[object]) -> None:
        for output in outputs:
            received.put((name, output))

    return deliver


@pytest.fixture
def received() -> Received:
    return queue.SimpleQueue()


def test_outputs_are_delivered_in_order(received: Received) -> None:
    schedule = BusSchedule()
    schedule.add("meter", Meter())
    host = BusThread(SystemWire(), schedule, into(received))
    host.start()
    assert received.get(timeout=5) == ("meter", Identity("meter"))
    stamps = [received.get(timeout=5)[1] for _ in range(3)]
    assert all(isinstance(one, Stamped) for one in stamps)
    host.stop()


def test_stopping_closes_the_bus_although_it_sleeps() -> None:
    bus = SystemWire()
    host = BusThread(bus, BusSchedule(), lambda *_: None)
    host.start()
    host.stop()
    assert bus.closed
    assert not host.is_alive()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_mistake_of_our_own_interrupts_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    killed: queue.SimpleQueue[tuple[int, int]] = queue.SimpleQueue()
    monkeypatch.setattr(os, "kill", lambda pid, number: killed.put((pid, number)))

    class Wrong(Meter):
        def configure(self) -> Program[Identity]:
            yield Pause(0.0)
            raise ZeroDivisionError

    schedule = BusSchedule()
    schedule.add("wrong", Wrong())
    host = BusThread(SystemWire(), schedule, lambda *_: None)
    host.start()
    assert killed.get(timeout=5) == (os.getpid(), signal.SIGINT)
    host.stop()
    assert isinstance(host.failure, ZeroDivisionError)
