"""Recorded frames into devices: in step, after failures that were not recorded, and where the driver has changed."""

from itertools import pairwise
from typing import Any, TypeAlias

from hindrax_core.bus_operations import DeviceError, Pause, Program, Transaction, Write, WriteRead, pack_transaction
from hindrax_core.driver_interface import Identity
from hindrax_core.events import NS_PER_S, Stamp, Stamped
from hindrax_core.readings import Pressure
from hindrax_replay.recorded_devices import RegisterWire, SerialWire

SETUP = Write(0x10, b"\x01")
CONVERT = Write(0x10, b"\x02")
FETCH = WriteRead(0x10, b"\x03", 1)
Script: TypeAlias = list[tuple[int, Transaction, bytes]]


class Gauge:
    """A register device of two transactions and a pause."""

    period_s = 0.1

    def configure(self) -> Program[Identity]:
        yield SETUP
        return Identity("gauge")

    def cycle(self, stamp: Stamp) -> Program[Any]:
        yield CONVERT
        yield Pause(0.01)
        raw = yield FETCH
        if raw == b"\xff":
            raise DeviceError("nonsense")
        return [Stamped(stamp, Pressure(float(raw[0]), 20.0))]


def _run(wire: RegisterWire, script: Script) -> list[object]:
    outputs: list[object] = []
    for second, transaction, answer in script:
        stamp = Stamp(second * NS_PER_S)
        outputs += wire.frame(stamp, 1, pack_transaction(transaction))
        outputs += wire.frame(stamp, 0, answer)
    return outputs


def _pressures(outputs: list[object]) -> list[tuple[int, float]]:
    return [(one.stamp // NS_PER_S, one.reading.pressure_Pa) for one in outputs if isinstance(one, Stamped)]


def test_programs_run_in_step_with_the_record() -> None:
    wire = RegisterWire("gauge", Gauge())
    outputs = _run(
        wire, [(1, SETUP, b""), (2, CONVERT, b""), (2, FETCH, b"\x07"), (3, CONVERT, b""), (3, FETCH, b"\x08")]
    )
    assert outputs[0] == Identity("gauge")
    assert _pressures(outputs) == [(2, 7.0), (3, 8.0)]
    assert wire.mismatches == []


def test_a_transaction_that_is_not_recorded_had_failed() -> None:
    wire = RegisterWire("gauge", Gauge())
    # At 3 s the fetch failed on the wire: the record goes on with the device being configured anew.
    script: Script = [
        (1, SETUP, b""),
        (3, CONVERT, b""),
        (4, SETUP, b""),
        (5, CONVERT, b""),
        (5, FETCH, b"\x09"),
    ]
    assert _pressures(_run(wire, script)) == [(5, 9.0)]
    assert wire.mismatches == []


def test_a_program_that_refuses_an_answer_is_begun_anew() -> None:
    wire = RegisterWire("gauge", Gauge())
    script: Script = [
        (1, SETUP, b""),
        (2, CONVERT, b""),
        (2, FETCH, b"\xff"),
        (3, SETUP, b""),
        (4, CONVERT, b""),
    ]
    outputs = _run(wire, [*script, (4, FETCH, b"\x05")])
    assert _pressures(outputs) == [(4, 5.0)]
    assert wire.mismatches == []


def test_a_record_of_another_driver_is_strange() -> None:
    wire = RegisterWire("gauge", Gauge())
    assert _run(wire, [(1, Write(0x10, b"\x55"), b"")]) == []
    assert len(wire.mismatches) == 1
    assert "the record has Write(address=16, data=b'U')" in wire.mismatches[0]


class Echoing:
    """A serial device that notes what it was told."""

    baud = 9600
    ready = True

    def __init__(self) -> None:
        self.received: list[tuple[str, float, bytes]] = []

    def start(self, stamp: Stamp) -> tuple[()]:
        self.received.append(("start", stamp / NS_PER_S, b""))
        return ()

    def feed(self, data: bytes, stamp: Stamp) -> tuple[()]:
        self.received.append(("feed", stamp / NS_PER_S, data))
        return ()

    def tick(self, stamp: Stamp) -> tuple[()]:
        self.received.append(("tick", stamp / NS_PER_S, b""))
        return ()


def test_serial_device_receives_bytes_and_the_passing_of_time() -> None:
    device = Echoing()
    wire = SerialWire(device)
    for stamp, direction, data in [(1.0, 1, b"order"), (1.02, 0, b"ab"), (1.14, 0, b"cd")]:
        list(wire.frame(Stamp(round(stamp * NS_PER_S)), direction, data))
    assert [one for one in device.received if one[0] != "tick"] == [
        ("start", 1.0, b""),
        ("feed", 1.02, b"ab"),
        ("feed", 1.14, b"cd"),
    ]
    ticks = [at for word, at, _ in device.received if word == "tick"]
    assert max(later - earlier for earlier, later in pairwise(ticks)) <= 0.0501
