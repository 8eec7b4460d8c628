"""What a person has to do is told once the device that will see it has answered, and not before."""

import errno
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from hindrax_cli.command_line import main
from hindrax_sim.buses.virtual_i2c import VirtualI2c
from hindrax_sim.testing.mock_wires import jumping_bus

BY_HAND = (
    ["imu", "calibrate", "--seconds", "600"],
    ["depth", "tare", "--seconds", "600"],
    ["oscillator"],
    ["esc", "calibrate", "--propellers-off"],
)


@pytest.fixture
def empty_bus(tmp_path: Path) -> Iterator[str]:
    """A bus without any device."""
    with jumping_bus(tmp_path / "i2c", VirtualI2c().transfer) as port:
        yield port


@pytest.mark.parametrize("words", BY_HAND, ids=lambda words: words[0])
def test_without_the_bus_there_is_one_sentence(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*words, "--port", "/dev/i2c-nowhere"]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert "/dev/i2c-nowhere" in captured.err


@pytest.mark.parametrize("words", [one for one in BY_HAND if one[0] != "esc"], ids=lambda words: words[0])
def test_a_vehicle_file_that_cannot_be_changed_is_reported_before_anything_is_measured(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened = Path.open

    def read_only(file: Path, mode: str = "r", *more: Any, **options: Any) -> Any:
        if mode != "r":
            raise OSError(errno.EROFS, "Read-only file system")
        return opened(file, mode, *more, **options)

    monkeypatch.setattr(Path, "open", read_only)
    assert main([*words, "--write", "--port", "/dev/i2c-nowhere"]) == 2
    printed = capsys.readouterr().err
    assert printed.count("\n") == 1
    assert "--write: " in printed
    assert "cannot be written (Read-only file system)" in printed


@pytest.mark.parametrize("words", BY_HAND, ids=lambda words: words[0])
def test_without_the_device_there_is_one_sentence(
    words: list[str], empty_bus: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "--port", empty_bus]) == 1
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert "no acknowledge: not wired, not powered, or another address" in captured.err
