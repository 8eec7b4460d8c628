"""`hindrax esc` on the emulated chip: what is put out at each step, and what it refuses."""

import io
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from hindrax_bringup.share_files import default_vehicle, hindrax_with
from hindrax_cli.command_line import main
from hindrax_cli.commands.machine import output as command
from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import Battery
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.bus_capture import CapturedReadings
from hindrax_drivers.nodes.thruster_settings import Settings
from hindrax_sim.buses.virtual_i2c import VirtualI2c
from hindrax_sim.devices.pca9685 import Pca9685
from hindrax_sim.testing.lock_step import run_at_once

Say = Callable[..., int]
NEUTRAL = (1500.0,) * 8


@pytest.fixture
def chip(monkeypatch: pytest.MonkeyPatch) -> Iterator[Pca9685]:
    made, wires = Pca9685(), VirtualI2c()
    wires.attach(0x40, made)
    monkeypatch.setattr(command, "run_once", run_at_once(wires))
    monkeypatch.setattr(command, "vehicle_stack", lambda: None)
    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    yield made
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture
def say(monkeypatch: pytest.MonkeyPatch) -> Say:
    def words(*arguments: str, answers: str = "off\n\n\n") -> int:
        monkeypatch.setattr(sys, "stdin", io.StringIO(answers))
        return main(["esc", "calibrate", "--vehicle", str(default_vehicle()), *arguments])

    return words


def put_out(chip: Pca9685) -> list[tuple[float, ...]]:
    """Pulses of the thrusters one after the other, to the microsecond that a count is."""
    found = [tuple(round(pulse or 0.0, -1) for pulse in change.pulses_us[:8]) for change in chip.changes]
    return [one for before, one in zip([(), *found], found, strict=False) if one != before and any(one)]


def test_full_then_least_throttle_then_neutral_and_the_others_never_move(chip: Pca9685, say: Say) -> None:
    assert say("--thrusters", "T2", "T3", "--propellers-off") == 0
    full, least = [1500.0] * 8, [1500.0] * 8
    full[1] = full[2] = 1900.0
    least[1] = least[2] = 1100.0
    assert put_out(chip) == [NEUTRAL, tuple(full), tuple(least), NEUTRAL]
    assert not chip.violations


def test_the_others_and_the_end_rest_where_the_node_would(chip: Pca9685, say: Say) -> None:
    assert say("--thrusters", "T1", "--propellers-off", "--set", "thrusters.neutral_us:=1520") == 0
    assert put_out(chip)[0] == put_out(chip)[-1] == (1520.0,) * 8
    assert put_out(chip)[1] == (1900.0, *(1520.0,) * 7)


@pytest.mark.parametrize(
    ("arguments", "case"),
    [
        ((), ("", "remove every propeller")),
        (("--thrusters", "T9", "--propellers-off"), ("", "found T9, wanted thrusters of T1")),
        (("--propellers-off",), ("yes\n", "wanted `off`; only neutral")),
        (("--propellers-off",), ("", "the input ended")),
    ],
)
def test_what_it_refuses_moves_nothing(
    chip: Pca9685, say: Say, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], case: tuple[str, str]
) -> None:
    answers, sentence = case
    assert say(*arguments, answers=answers) in (1, 2)
    assert sentence in capsys.readouterr().err
    assert put_out(chip) in ([], [NEUTRAL])


def test_an_enable_line_that_is_not_there_is_one_sentence(
    chip: Pca9685, say: Say, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    vehicle = load_vehicle(default_vehicle())
    lined = replace(vehicle, output=replace(vehicle.output, enable_line="nowhere:4"))
    monkeypatch.setattr(command, "output_settings", lambda _: Settings(lined, "/dev/i2c-1"))
    assert say("--propellers-off") == 1
    assert capsys.readouterr().err.startswith("hindrax esc: GPIO: ")
    assert put_out(chip) == []


@pytest.mark.parametrize("answers", ["off\n", "off\n\n"])
def test_an_input_that_ends_leaves_neutral(chip: Pca9685, say: Say, answers: str) -> None:
    assert say("--propellers-off", answers=answers) == 1
    assert put_out(chip)[-1] == NEUTRAL
    assert (1900.0,) * 8 in put_out(chip)


@pytest.fixture
def supplied(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """A vehicle with a battery sensor that reads a given voltage."""

    def reads(volts: float) -> None:
        received = CapturedReadings("INA226", (Stamped(Stamp(0), Battery(volts)),))
        monkeypatch.setattr(command, "output_settings", lambda _: Settings(hindrax_with("ina226"), "/dev/i2c-1"))
        monkeypatch.setattr(command, "capture", lambda *_: received)

    return reads


@pytest.mark.parametrize(("volts", "code"), [(14.8, 1), (0.1, 0)])
def test_speed_controllers_with_supply_get_no_full_throttle(
    chip: Pca9685, say: Say, supplied: Callable[[float], None], volts: float, code: int
) -> None:
    supplied(volts)
    assert say("--propellers-off") == code
    assert ((1900.0,) * 8 in put_out(chip)) == (code == 0)
    assert put_out(chip)[-1] == NEUTRAL
