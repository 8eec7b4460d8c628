"""The order of traffic on a bus: interleaving at pauses, urgency, back-off, the beat."""

from collections.abc import Sequence

import pytest

from hindrax_core.bus_operations import DeviceError, Pause, Program, Read, Transaction, Write
from hindrax_core.driver_interface import Identity, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped, stamp_from_s
from hindrax_core.readings import Battery, Reading
from hindrax_drivers.buses.bus_schedule import BusSchedule


class Converter:
    """Starts a conversion, waits, reads: like a pressure sensor."""

    def __init__(self, address: int, period_s: float, wait_s: float, slack_s: float = 0.0) -> None:
        self.address, self.period_s, self._wait_s, self._slack_s = address, period_s, wait_s, slack_s

    def configure(self) -> Program[Identity]:
        yield Write(self.address, b"\x1e")
        return Identity(f"converter {self.address:#x}")

    def cycle(self, stamp: Stamp) -> Program[Sequence[Stamped[Reading] | Rejected]]:
        yield Write(self.address, b"\x48")
        yield Pause(self._wait_s, self._slack_s)
        raw = yield Read(self.address, 1)
        return [Stamped(stamp, Battery(raw[0]))]


class Wire:
    """Answers with the address; can be told to refuse."""

    def __init__(self) -> None:
        self.now = Stamp(0)
        self.seen: list[tuple[float, Transaction]] = []
        self.broken: set[int] = set()

    def transfer(self, transaction: Transaction) -> bytes:
        self.seen.append((self.now / 1e9, transaction))
        if transaction.address in self.broken:
            raise DeviceError("nobody there")
        return b"" if isinstance(transaction, Write) else bytes([transaction.address])


def run(schedule: BusSchedule, wire: Wire, until_s: float) -> list[tuple[str, object]]:
    """Drive a schedule in lock-step; flattened outputs."""
    found: list[tuple[str, object]] = []
    while (due := schedule.next_due(wire.now)) <= stamp_from_s(until_s):
        wire.now = max(wire.now, due)
        for name, outputs in schedule.step(wire.now, wire.transfer):
            found += [(name, output) for output in outputs]
    return found


def test_a_device_is_configured_and_then_keeps_its_beat() -> None:
    schedule, wire = BusSchedule(), Wire()
    schedule.add("p", Converter(0x76, 0.02, 0.009))
    outputs = run(schedule, wire, 0.1)
    assert outputs[0] == ("p", Identity("converter 0x76"))
    stamps = [output.stamp for _, output in outputs if isinstance(output, Stamped)]
    assert stamps == [stamp_from_s(0.02 * turn) for turn in range(5)]
    assert schedule.ready("p")


def test_a_conversion_does_not_keep_the_bus_from_others() -> None:
    schedule, wire = BusSchedule(), Wire()
    schedule.add("slow", Converter(0x76, 0.02, 0.0185))
    schedule.add("fast", Converter(0x68, 0.005, 0.0))
    run(schedule, wire, 0.0199)
    between = [at for at, done in wire.seen if done.address == 0x68 and 0.0 < at < 0.0185]
    assert sorted(set(between)) == pytest.approx([0.005, 0.010, 0.015])


def test_a_pause_counts_from_the_end_of_the_transfers_before_it() -> None:
    schedule, wire = BusSchedule(), Wire()
    schedule.add("p", Converter(0x76, 1.0, 0.010))
    schedule.run_next(Stamp(0), wire.transfer)  # configured
    schedule.run_next(Stamp(0), wire.transfer)  # conversion begun; the transfer took 3 ms
    assert schedule.next_due(stamp_from_s(0.003)) == stamp_from_s(0.013)


def wakings(schedule: BusSchedule, wire: Wire, until_s: float) -> list[float]:
    """Times at which a host that sleeps whenever it may is awake."""
    found = []
    while (due := schedule.next_due(wire.now)) <= stamp_from_s(until_s):
        wire.now = max(wire.now, due)
        found.append(wire.now / 1e9)
        schedule.step(wire.now, wire.transfer)
    return found


def test_slack_lets_several_devices_share_the_wakings() -> None:
    schedule, wire = BusSchedule(), Wire()
    schedule.add("p", Converter(0x76, 0.02, 0.009, slack_s=0.011), stamp_from_s(0.003))
    schedule.add("i", Converter(0x68, 0.02, 0.0), stamp_from_s(0.006))
    wakings(schedule, wire, 0.05)
    assert wakings(schedule, wire, 0.15) == pytest.approx([0.06, 0.08, 0.10, 0.12, 0.14])


def test_slack_is_not_more_than_was_given() -> None:
    schedule, wire = BusSchedule(), Wire()
    schedule.add("p", Converter(0x76, 0.1, 0.009, slack_s=0.004))
    assert wakings(schedule, wire, 0.2) == pytest.approx([0.0, 0.013, 0.1, 0.113, 0.2])


def test_a_beat_that_was_missed_is_left_out_not_made_up_for() -> None:
    schedule, wire = BusSchedule(), Wire()
    schedule.add("p", Converter(0x76, 0.02, 0.0))
    run(schedule, wire, 0.05)
    wire.now = stamp_from_s(1.0)
    late = run(schedule, wire, 1.019)
    assert len(late) == 1


def test_a_failing_device_backs_off_reports_it_and_comes_back() -> None:
    schedule, wire = BusSchedule(), Wire()
    schedule.add("p", Converter(0x76, 0.02, 0.009))
    run(schedule, wire, 0.11)
    wire.broken = {0x76}
    troubles = [output for _, output in run(schedule, wire, 5.0)]
    assert troubles[0] == Trouble(stamp_from_s(0.12), "p: nobody there; configured anew at once")
    assert [t.text.rsplit("anew ")[1] for t in troubles if isinstance(t, Trouble)][:7] == [
        "at once", "in 0.1 s", "in 0.2 s", "in 0.4 s", "in 0.8 s", "in 1 s", "in 1 s",
    ]  # fmt: skip
    assert not schedule.ready("p")
    wire.broken = set()
    back = run(schedule, wire, 6.1)
    assert back[0] == ("p", Identity("converter 0x76"))
    assert schedule.ready("p")


def test_a_failure_of_one_device_leaves_the_others_on_their_beat() -> None:
    schedule, wire = BusSchedule(), Wire()
    schedule.add("sick", Converter(0x76, 0.02, 0.009))
    schedule.add("well", Converter(0x68, 0.005, 0.0))
    wire.broken = {0x76}
    outputs = run(schedule, wire, 1.0)
    assert len([1 for name, output in outputs if name == "well" and isinstance(output, Stamped)]) == 201


def test_an_answer_of_the_wrong_length_is_refused_whatever_the_adapter() -> None:
    schedule = BusSchedule()
    schedule.add("p", Converter(0x76, 0.02, 0.0))
    outputs = schedule.step(Stamp(0), lambda _: b"")
    assert "short read, found 0 bytes, wanted 1" in str(outputs)


def test_a_clock_that_is_set_back_does_not_stop_the_bus() -> None:
    schedule, wire = BusSchedule(), Wire()
    wire.now = stamp_from_s(1000.0)
    schedule.add("p", Converter(0x76, 0.02, 0.0))
    run(schedule, wire, 1000.1)
    wire.now = stamp_from_s(10.0)
    assert len(run(schedule, wire, 10.1)) in (5, 6)


def test_the_tap_sees_every_transaction_with_its_owner() -> None:
    seen: list[tuple[str, Stamp, Transaction, bytes]] = []
    schedule, wire = BusSchedule(tap=lambda *one: seen.append(one)), Wire()
    schedule.add("p", Converter(0x76, 0.02, 0.009))
    run(schedule, wire, 0.01)
    assert seen == [
        ("p", 0, Write(0x76, b"\x1e"), b""),
        ("p", 0, Write(0x76, b"\x48"), b""),
        ("p", stamp_from_s(0.009), Read(0x76, 1), b"\x76"),
    ]


def test_what_cannot_be_scheduled_is_refused_by_name() -> None:
    schedule = BusSchedule()
    schedule.add("p", Converter(0x76, 0.02, 0.0))
    with pytest.raises(ValueError, match="p: is in the schedule already"):
        schedule.add("p", Converter(0x76, 0.02, 0.0))
    with pytest.raises(ValueError, match=r"q: found a period of 0.0 s"):
        schedule.add("q", Converter(0x76, 0.0, 0.0))


def test_an_error_of_our_own_is_not_swallowed() -> None:
    class Broken(Converter):
        def configure(self) -> Program[Identity]:
            raise ZeroDivisionError
            yield

    schedule = BusSchedule()
    schedule.add("p", Broken(0x76, 1.0, 0.0))
    with pytest.raises(ZeroDivisionError):
        schedule.step(Stamp(0), Wire().transfer)
