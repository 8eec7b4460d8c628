"""The MS5837 emulator, command by command, as its data sheets have it."""

import pytest

from hindrax_core.readings import Pressure
from hindrax_sim.devices.ms5837 import PROM_02BA, PROM_30BA, Ms5837


def ready() -> Ms5837:
    part = Ms5837(noise=0.0)
    part.write(b"\x1e", 1.0)
    return part


def prom(part: Ms5837, now_s: float) -> list[int]:
    words = []
    for command in range(0xA0, 0xAE, 2):
        part.write(bytes([command]), now_s)
        words.append(int.from_bytes(part.read(2, now_s), "big"))
    return words


def test_the_prom_can_be_read_once_it_is_loaded() -> None:
    part = ready()
    assert prom(part, 1.001) == [0] * 7
    assert prom(part, 1.01) == list(PROM_30BA)
    assert prom(Ms5837("02BA"), 1.0) == list(PROM_02BA)


def convert(part: Ms5837, command: int, wait_s: float, now_s: float = 2.0) -> int:
    part.write(bytes([command]), now_s)
    part.write(b"\x00", now_s + wait_s)
    return int.from_bytes(part.read(3, now_s + wait_s), "big")


@pytest.mark.parametrize("step", range(6))
def test_a_conversion_takes_its_time_and_reading_early_spoils_it(step: int) -> None:
    part, longest_s = ready(), 2.2e-6 * (256 << step)
    assert convert(part, 0x40 + 2 * step, longest_s + 1e-5) > 1_000_000
    assert convert(part, 0x40 + 2 * step, 0.9 * longest_s, 3.0) == 0
    part.write(b"\x00", 4.0)
    assert part.read(3, 4.0) == b"\0\0\0"


def test_a_conversion_can_be_read_once() -> None:
    part = ready()
    assert convert(part, 0x48, 0.01) > 0
    part.write(b"\x00", 3.0)
    assert part.read(3, 3.0) == b"\0\0\0"


def test_a_second_order_spoils_the_first() -> None:
    part = ready()
    part.write(b"\x48", 2.0)
    part.write(b"\x58", 2.005)
    part.write(b"\x00", 2.02)
    assert part.read(3, 2.02) == b"\0\0\0"


def test_nothing_is_read_without_a_command() -> None:
    part = Ms5837()
    assert part.read(3, 1.0) == b"\0\0\0"
    part.write(b"", 1.0)
    assert part.read(2, 1.0) == b"\0\0"


def test_the_example_of_the_data_sheet_is_its_own_inverse() -> None:
    """DS 30BA page 7: D1 4958179, D2 6815414 are 3999.8 mbar and 19.81 C, to the width of one printed step."""
    part = ready()
    part.set_truth(Pressure(399_980.0, 19.81), 2.0)
    assert convert(part, 0x58, 0.01) == pytest.approx(6815414, abs=320)
    assert convert(part, 0x48, 0.01, 3.0) == pytest.approx(4958179, abs=120)


def test_noise_is_drawn_from_the_seed() -> None:
    def values(seed: int) -> list[int]:
        part = Ms5837(seed=seed)
        part.write(b"\x1e", 1.0)
        return [convert(part, 0x48, 0.01, 2.0 + turn) for turn in range(5)]

    assert values(1) == values(1)
    assert values(1) != values(2)
    assert len(set(values(1))) > 1
