"""`hindrax oscillator` against the emulated chip, whose pulses come back on a line of a stand-in GPIO."""

import json
import random
from collections.abc import Callable
from pathlib import Path

import pytest

from hindrax_bringup.testing.vehicle_files import hindrax_file
from hindrax_cli.command_line import main
from hindrax_cli.commands.machine import output as command
from hindrax_core.bus_operations import EDGES, DeviceError
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.output.oscillator import LOOKS, Edge, clock_Hz
from hindrax_sim.buses.virtual_i2c import VirtualI2c
from hindrax_sim.devices.pca9685 import LoopBack, Pca9685
from hindrax_sim.testing.lock_step import run_at_once

TRUE_Hz = 25e6 * 1.031
PRESCALE = 30


def pulses(seconds: float, rate_Hz: float, jitter_ns: float = 3_000.0) -> list[Edge]:
    """Looks at a line with pulses, which a busy kernel stamps late."""
    dice = random.Random(3)
    numbers = [round(n * seconds * rate_Hz / LOOKS) for n in range(LOOKS + 1)]
    return [(n, round(n * 1e9 / rate_Hz + dice.uniform(0.0, jitter_ns))) for n in numbers]


def test_the_clock_is_found_by_the_edges() -> None:
    found = clock_Hz(pulses(10.0, TRUE_Hz / 4096 / (PRESCALE + 1)), PRESCALE)
    assert found == pytest.approx(TRUE_Hz, rel=5e-6)


@pytest.mark.parametrize(
    ("seen", "sentence"),
    [
        ([(0, 0)] * 51, "found 0 edges, wanted at least 100; check wire, channel"),
        (
            [(40 * n, time) for n, time in enumerate(sorted(random.Random(1).sample(range(10**10), 51)))],
            "intervals irregular, wanted pulses",
        ),
        ([(40 * n, 10**9) for n in range(51)], "intervals irregular"),
        (pulses(10.0, 50.0), "wanted 20 to 50 MHz; is another signal on the line"),
    ],
)
def test_another_signal_is_no_clock(seen: list[Edge], sentence: str) -> None:
    with pytest.raises(DeviceError, match=sentence):
        clock_Hz(seen, PRESCALE)


@pytest.fixture
def chip(monkeypatch: pytest.MonkeyPatch) -> Pca9685:
    """A chip whose oscillator is off, with its channel 15 at line 17 of a GPIO chip."""
    made, wires = Pca9685(clock_error=0.031), VirtualI2c()
    wires.attach(0x40, made)
    wires.attach(EDGES + 17, LoopBack(made, 15))
    monkeypatch.setattr(command, "run_once", run_at_once(wires))
    monkeypatch.setattr(command, "vehicle_stack", lambda: None)
    return made


@pytest.fixture
def say(tmp_path: Path) -> Callable[..., tuple[int, Path]]:
    file = hindrax_file(tmp_path)
    return lambda *words: (main(["oscillator", "--vehicle", str(file), *words]), file)


def test_it_measures_keeps_and_switches_the_channel_off(
    chip: Pca9685, say: Callable[..., tuple[int, Path]], capsys: pytest.CaptureFixture[str]
) -> None:
    code, file = say("--write", "--json")
    assert code == 0
    captured = capsys.readouterr()
    assert json.loads(captured.out)["clock_Hz"] == pytest.approx(TRUE_Hz, rel=1e-5)
    assert "the thrusters get their neutral pulse" in captured.err
    assert load_vehicle(file).output.clock_Hz == pytest.approx(TRUE_Hz, rel=1e-5)
    assert chip.pulse_us(15) is None
    assert not chip.violations
    (running,) = [one for one in chip.changes if one.pulses_us[15] is not None]
    assert running.pulses_us[15] == pytest.approx(0.5e6 / chip.rate_Hz)
    assert running.pulses_us[:8] == pytest.approx((1500.0 / 1.031,) * 8, abs=3.0), "neutral by the clock of the file"


def test_meanwhile_the_thrusters_rest_where_the_node_would(chip: Pca9685, say: Callable[..., tuple[int, Path]]) -> None:
    assert say("--set", "thrusters.neutral_us:=1560")[0] == 0
    found = {one.pulses_us[:8] for one in chip.changes if one.pulses_us[0] is not None}
    assert [pulses == pytest.approx((1560.0 / 1.031,) * 8, abs=3.0) for pulses in found] == [True]


def test_without_the_wire_the_channel_is_off_again_and_nothing_is_kept(
    chip: Pca9685,
    say: Callable[..., tuple[int, Path]],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(LoopBack, "read", lambda _self, count, _now_s: bytes(count))
    code, file = say("--write")
    assert code == 1
    assert "check wire, channel and GPIO line" in capsys.readouterr().err
    assert chip.pulse_us(15) is None
    assert load_vehicle(file).output.clock_Hz is None


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--channel", "3"], "found 3, wanted one without thruster or lamp: 10, 11"),
        (["--gpio", "17"], "wanted CHIP:LINE"),
    ],
)
@pytest.mark.usefixtures("chip")
def test_wrong_words_are_refused_before_anything_moves(
    words: list[str], sentence: str, say: Callable[..., tuple[int, Path]], capsys: pytest.CaptureFixture[str]
) -> None:
    assert say(*words)[0] == 2
    assert sentence in capsys.readouterr().err
