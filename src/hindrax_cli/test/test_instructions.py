"""What a person has to do is told once the device that will see it has answered, and not before."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from hindrax_cli.command_line import main
from hindrax_core.events import Stamp
from hindrax_sim.buses.mock_server import BusServer
from hindrax_sim.buses.virtual_i2c import VirtualI2c

BY_HAND = (
    ["imu", "calibrate", "--seconds", "600"],
    ["depth", "tare", "--seconds", "600"],
    ["oscillator"],
    ["esc", "calibrate", "--propellers-off"],
)


@pytest.fixture
def empty_bus(tmp_path: Path) -> Iterator[str]:
    """A bus without any device, whose time jumps from one wish of the tool to the next."""
    wires = VirtualI2c()
    server = BusServer(str(tmp_path / "i2c"), wires.transfer, Stamp(10**9))
    stop = threading.Event()

    def serve() -> None:
        now = Stamp(10**9)
        while not stop.is_set():
            server.serve(now, 0.001)
            if not server.busy() and server.earliest_wakeup() < 1 << 62:
                now = max(now, server.earliest_wakeup())

    thread = threading.Thread(target=serve)
    thread.start()
    yield f"mock:{tmp_path / 'i2c'}"
    stop.set()
    thread.join()
    server.close()


@pytest.mark.parametrize("words", BY_HAND, ids=lambda words: words[0])
def test_without_the_bus_there_is_one_sentence(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*words, "--port", "/dev/i2c-nowhere"]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert "/dev/i2c-nowhere" in said.err


@pytest.mark.parametrize("words", BY_HAND, ids=lambda words: words[0])
def test_without_the_device_there_is_one_sentence(
    words: list[str], empty_bus: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "--port", empty_bus]) == 1
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert "no acknowledge: not wired, not powered, or another address" in said.err
