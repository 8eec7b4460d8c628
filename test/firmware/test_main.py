"""Pins, timers, link and watchdog, on a fake board."""

import importlib.util
import sys
import time
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import pytest
from pymavlink.dialects.v20 import common

MAIN = Path(__file__).parents[2] / "firmware/main.py"
WRAP = 2**30


class Channel:
    def __init__(self, pin: str, pulse: int) -> None:
        self.pin, self.pulse = pin, pulse

    def pulse_width(self, pulse: int) -> None:
        self.pulse = pulse


class Timer:
    PWM = 0
    made: ClassVar[dict[int, "Timer"]] = {}

    def __init__(self, number: int) -> None:
        self.number = number
        self.channels: dict[int, Channel] = {}
        Timer.made[number] = self

    def source_freq(self) -> int:
        return 168_000_000 if self.number == 9 else 84_000_000

    def init(self, *, prescaler: int, period: int) -> None:
        self.tick_us = (prescaler + 1) * 1e6 / self.source_freq()
        self.period_us = (period + 1) * self.tick_us

    def channel(self, number: int, _mode: int, *, pin: str, pulse_width: int) -> Channel:
        made = self.channels[number] = Channel(pin, pulse_width)
        return made


class Uart:
    def __init__(self, *_arguments: Any, **_options: Any) -> None:
        self.incoming, self.sent = b"", b""

    def any(self) -> int:
        return len(self.incoming)

    def read(self, count: int) -> bytes:
        data, self.incoming = self.incoming[:count], self.incoming[count:]
        return data

    def write(self, data: bytes) -> None:
        self.sent += data


class Usb(Uart):
    interrupt: int | None = None

    def setinterrupt(self, character: int) -> None:
        self.interrupt = character


class Watchdog:
    def __init__(self, *, timeout: int) -> None:
        self.timeout, self.fed = timeout, 0

    def feed(self) -> None:
        self.fed += 1


class Adc:
    def __init__(self, _pin: str) -> None:
        pass

    def read(self) -> int:
        return 3700


@pytest.fixture
def board(monkeypatch: pytest.MonkeyPatch) -> Any:
    machine, pyb = ModuleType("machine"), ModuleType("pyb")
    machine.WDT = Watchdog  # type: ignore[attr-defined]
    pyb.Timer, pyb.Pin, pyb.UART, pyb.USB_VCP, pyb.ADC = Timer, str, Uart, Usb, Adc  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "machine", machine)
    monkeypatch.setitem(sys.modules, "pyb", pyb)
    clock = {"ms": WRAP - 100}
    monkeypatch.setattr(time, "ticks_ms", lambda: clock["ms"] % WRAP, raising=False)
    monkeypatch.setattr(time, "ticks_diff", lambda a, b: (a - b + WRAP // 2) % WRAP - WRAP // 2, raising=False)
    spec = importlib.util.spec_from_file_location("firmware_main", MAIN)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.fake_clock = clock  # type: ignore[attr-defined]
    return module


def pulses() -> list[int]:
    timers = Timer.made
    return [timers[number].channels[one].pulse for number in (3, 4) for one in (1, 2, 3, 4)]


def test_every_output_starts_neutral_with_ticks_of_one_microsecond(board: Any) -> None:
    made = board.Board()
    assert pulses() == [1500] * 8
    assert [channel.pulse for channel in Timer.made[9].channels.values()] == [1100, 1100]
    for timer in Timer.made.values():
        assert (timer.tick_us, timer.period_us) == (1.0, 5000.0)
    assert len({channel.pin for timer in Timer.made.values() for channel in timer.channels.values()}) == 10
    assert made.watchdog.timeout == 500


def test_a_flight_across_the_wrap_of_the_millisecond_counter(board: Any) -> None:
    made, sender = board.Board(), common.MAVLink(None, srcSystem=1, srcComponent=191)
    override = sender.rc_channels_override_encode(1, 1, *[1900] * 10).pack(sender)
    for _ in range(700):
        board.fake_clock["ms"] += 10
        made.link.incoming = override
        made.turn()
    assert pulses() == [1500] * 8
    neutral = sender.rc_channels_override_encode(1, 1, *[1500] * 8).pack(sender)
    arm = sender.command_long_encode(1, 1, 400, 0, 1.0, 0, 0, 0, 0, 0, 0).pack(sender)
    made.link.incoming = neutral + arm + override
    made.turn()
    assert pulses() == [1900] * 8
    messages = [message.get_type() for message in common.MAVLink(None).parse_buffer(made.link.sent)]
    assert messages.count("HEARTBEAT") in (7, 8)
    assert "COMMAND_ACK" in messages
    board.fake_clock["ms"] += 300
    made.turn()
    assert pulses() == [1500] * 8
    assert made.watchdog.fed == 702


def test_an_error_in_a_turn_starves_the_watchdog(board: Any) -> None:
    made = board.Board()
    made.outputs.write = None
    with pytest.raises(TypeError):
        made.turn()
    assert made.watchdog.fed == 0


def test_usb_does_not_take_a_byte_for_ctrl_c(board: Any) -> None:
    board.USE_USB = True
    assert board.Board().link.interrupt == -1


def test_battery(board: Any) -> None:
    board.BATTERY_PIN = "PA0"
    made = board.Board()
    made.turn()
    messages = {message.get_type(): message for message in common.MAVLink(None).parse_buffer(made.link.sent)}
    assert messages["BATTERY_STATUS"].voltages[0] == 14800
