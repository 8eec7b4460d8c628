"""Lines of a GPIO chip, the one that enables the outputs among them, on a fake libgpiod 2."""

import struct
import sys
import threading
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from hindrax_core.bus_operations import EDGES, DeviceError, Read, Write
from hindrax_core.events import NS_PER_S
from hindrax_core.stack_time import StackTime
from hindrax_core.vehicle import Output, load_vehicle
from hindrax_drivers.buses import gpio
from hindrax_drivers.buses.ports import open_bus
from hindrax_drivers.output import enable_line
from hindrax_drivers.output.enable_line import TRIGGER_S, open_enable_line, outputs_enabled
from hindrax_drivers.output.output_guard import guard_of
from hindrax_drivers.output.output_ports import open_output

LINE, BUS = "pinctrl-bcm2711:26", "/dev/i2c-1"
LABELS = {"gpiochip0": "pinctrl-bcm2711", "gpiochip1": "raspberrypi-exp-gpio"}


class FakeGpiod(ModuleType):
    """Levels of lines as the chip puts them out: low is 0."""

    def __init__(self) -> None:
        super().__init__("gpiod")
        self.levels: dict[tuple[str, int], int] = {}
        self.written: list[int] = []
        self.line = SimpleNamespace(
            Direction=SimpleNamespace(OUTPUT="output", INPUT="input"),
            Bias=SimpleNamespace(AS_IS="none", PULL_UP="up", PULL_DOWN="down"),
            Value=SimpleNamespace(ACTIVE=1, INACTIVE=0),
            Edge=SimpleNamespace(RISING="rising"),
            Clock=SimpleNamespace(MONOTONIC="monotonic"),
        )
        self.LineSettings = SimpleNamespace
        self.busy = False
        self.edges: list[tuple[int, int]] = []
        self.requested = 0

    def Chip(self, path: str) -> Any:
        name = Path(path).name
        info = SimpleNamespace(label=LABELS[name], name=name)

        class Opened:
            def __enter__(self) -> Any:
                return SimpleNamespace(get_info=lambda: info)

            def __exit__(self, *_: object) -> None:
                pass

        return Opened()

    def request_lines(self, path: str, *, consumer: str, config: dict[int, Any]) -> Any:
        assert consumer
        if self.busy:
            raise OSError(16, "Device or resource busy")
        ((line, settings),) = config.items()
        key = (Path(path).name, line)
        if settings.direction == "input":
            if hasattr(settings, "edge_detection"):
                return self._watched(settings)
            self.levels.setdefault(key, int(settings.bias == "up"))
            return SimpleNamespace(get_value=lambda number: self._level(key[0], number), release=lambda: None)
        assert settings.active_low
        assert settings.direction == "output"
        self.levels[key] = 1 - settings.output_value

        def set_value(number: int, value: int) -> None:
            self.levels[key[0], number] = 1 - value
            self.written.append(1 - value)

        return SimpleNamespace(set_value=set_value, release=lambda: self.levels.pop(key))

    def _watched(self, settings: Any) -> Any:
        """A request for edges: those of `edges` wait to be read, two at a time as in a small buffer."""
        assert (settings.edge_detection, settings.event_clock) == ("rising", "monotonic")
        self.requested += 1

        def read() -> list[Any]:
            found, self.edges = self.edges[:2], self.edges[2:]
            return [SimpleNamespace(line_seqno=number, timestamp_ns=time_ns) for number, time_ns in found]

        def release() -> None:
            self.requested -= 1

        return SimpleNamespace(wait_edge_events=lambda _: bool(self.edges), read_edge_events=read, release=release)

    def _level(self, chip: str, line: int) -> int:
        if self.busy:
            raise OSError(19, "No such device")
        return self.levels[chip, line]


@pytest.fixture
def gpiod(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> FakeGpiod:
    for name in LABELS:
        (tmp_path / name).touch()
    fake = FakeGpiod()
    monkeypatch.setitem(sys.modules, "gpiod", fake)
    monkeypatch.setattr(gpio, "DEVICES", tmp_path)
    return fake


def test_the_outputs_are_off_until_they_are_enabled_and_low_enables(gpiod: FakeGpiod) -> None:
    line = open_enable_line(Output(enable_line=LINE), BUS)
    assert gpiod.levels == {("gpiochip0", 26): 1}
    line.set(enabled=True)
    assert gpiod.levels == {("gpiochip0", 26): 0}
    line.set(enabled=False)
    assert gpiod.levels == {("gpiochip0", 26): 1}
    line.close()
    assert gpiod.levels == {}


def test_a_timer_gets_a_low_pulse_for_each_write_while_the_outputs_are_enabled(gpiod: FakeGpiod) -> None:
    line = open_enable_line(Output(enable_line=LINE, enable_timer=True), BUS)
    line.written()
    assert gpiod.written == []
    line.set(enabled=True)
    line.written()
    assert gpiod.written == [0, 1, 0, 1]
    line.set(enabled=False)
    line.written()
    assert gpiod.written == [0, 1, 0, 1]


def test_a_mock_has_no_line_whatever_the_vehicle_file_states(gpiod: FakeGpiod) -> None:
    line = open_enable_line(Output(enable_line=LINE), "mock:/tmp/i2c")
    line.set(enabled=True)
    line.close()
    assert gpiod.levels == {}


def test_no_name_is_no_line() -> None:
    line = open_enable_line(Output(), BUS)
    line.set(enabled=True)
    line.written()
    line.close()


@pytest.mark.usefixtures("gpiod")
def test_a_chip_that_is_not_there_is_refused() -> None:
    with pytest.raises(DeviceError, match="found the chips pinctrl-bcm2711"):
        open_enable_line(Output(enable_line="nochip:26"), BUS)


def test_a_line_in_use_is_reported_with_the_remedy(gpiod: FakeGpiod) -> None:
    gpiod.busy = True
    with pytest.raises(DeviceError, match=r"busy.*gpioinfo"):
        open_enable_line(Output(enable_line=LINE), BUS)


def test_a_missing_library_is_reported_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gpiod", None)
    with pytest.raises(DeviceError, match="pip install"):
        open_enable_line(Output(enable_line=LINE), BUS)


def test_a_chip_is_a_bus_of_lines(gpiod: FakeGpiod) -> None:
    bus = open_bus("gpio:pinctrl-bcm2711")
    with pytest.raises(DeviceError, match="wanted a line that is set up"):
        bus.transfer(Read(27, 1))
    bus.transfer(Write(27, b"\x01"))
    assert bus.transfer(Read(27, 1)) == b"\x01", "the pull-up of a line that nothing is connected to"
    gpiod.levels["gpiochip0", 27] = 0
    assert bus.transfer(Read(27, 1)) == b"\x00"
    bus.transfer(Write(27, b"\x02"))
    gpiod.busy = True
    with pytest.raises(DeviceError, match=r"pinctrl-bcm2711:27: cannot be read \(No such device\)"):
        bus.transfer(Read(27, 1))
    bus.close()


@pytest.mark.usefixtures("gpiod")
def test_a_chip_that_is_not_there_is_reported() -> None:
    with pytest.raises(DeviceError, match="found the chips pinctrl-bcm2711"):
        open_bus("gpio:elsewhere")


def test_lines_beside_a_bus_are_counted_and_stamped_by_the_kernel(gpiod: FakeGpiod) -> None:
    epoch_ns = 1_700_000_000 * NS_PER_S
    lines = gpio.EdgeLines(StackTime(epoch_ns))
    with pytest.raises(DeviceError, match="wanted a line that is watched"):
        lines.transfer(Read(EDGES + 17, 12))
    lines.transfer(Write(EDGES + 17, b"pinctrl-bcm2711"))
    assert lines.transfer(Read(EDGES + 17, 12)) == bytes(12), "no edge yet"
    gpiod.edges = [(1, 100), (2, 200), (3, 300)]
    assert lines.transfer(Read(EDGES + 17, 12)) == struct.pack(">Iq", 3, epoch_ns + 300)
    assert lines.transfer(Read(EDGES + 17, 12)) == struct.pack(">Iq", 3, epoch_ns + 300), "the newest stays"
    lines.transfer(Write(EDGES + 17, b"pinctrl-bcm2711"))
    assert lines.transfer(Read(EDGES + 17, 12)) == bytes(12), "watched anew"
    with pytest.raises(DeviceError, match="found the chips"):
        lines.transfer(Write(EDGES + 17, b"elsewhere"))
    lines.close()
    assert gpiod.requested == 0


@pytest.mark.parametrize("timer", [False, True])
def test_outputs_are_enabled_for_a_while_and_the_line_is_given_back(gpiod: FakeGpiod, *, timer: bool) -> None:
    levels, low = gpiod.levels, threading.Event()

    class Watched(dict[tuple[str, int], int]):
        def __setitem__(self, key: tuple[str, int], level: int) -> None:
            super().__setitem__(key, level)
            self.times = getattr(self, "times", 0) + (level == 0)
            if self.times == (3 if timer else 1):
                low.set()

    gpiod.levels = levels = Watched()
    output = Output(enable_line=LINE, enable_timer=timer)
    with outputs_enabled(output, BUS):
        assert low.wait(10.0), "a timer is triggered again and again"
    assert gpiod.written[-1] == 1, "a line that is given back may keep its level: the outputs are off before"
    assert levels == {}, "given back"


def test_a_pulse_that_is_on_its_way_at_the_end_comes_before_the_outputs_are_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    entered, done, happened = threading.Event(), threading.Event(), list[str]()

    class SlowLine:
        def set(self, *, enabled: bool) -> None:
            happened.append("on" if enabled else "off")

        def written(self) -> None:
            entered.set()
            done.wait(10.0)
            happened.append("pulse")

        def close(self) -> None:
            happened.append("closed")

    monkeypatch.setattr(enable_line, "open_enable_line", lambda _output, _port: SlowLine())
    with outputs_enabled(Output(), BUS):
        assert entered.wait(10.0)
        threading.Timer(0.1, done.set).start()
    done.wait(10.0)
    assert happened == ["on", "pulse", "off", "closed"]


def test_a_line_is_given_back_when_the_bus_behind_it_cannot_be_opened(gpiod: FakeGpiod, tmp_path: Path) -> None:
    vehicle = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
    wired = replace(vehicle, output=replace(vehicle.output, enable_line=LINE))
    with pytest.raises(DeviceError, match="no such"):
        open_output(wired, str(tmp_path / "i2c-7"), "", lambda *_: None, "thrusters", neutral=guard_of(wired).neutral)
    assert gpiod.levels == {}


def test_a_timer_that_runs_out_after_0_3_s_is_triggered_early_enough_with_one_pulse_lost() -> None:
    assert 2.0 * TRIGGER_S < 0.3
