"""MS5837 against the numbers of its data sheets."""

from collections.abc import Callable
from dataclasses import astuple
from pathlib import Path
from typing import Any

import pytest
import yaml

from hindrax_core.bus_operations import DeviceError, Operation, Pause, Write, WriteRead
from hindrax_core.events import Rejected, Stamp, Stamped, stamp_from_s
from hindrax_core.readings import Pressure
from hindrax_core.testing import rehearse
from hindrax_drivers.devices.ms5837 import (
    CONVERSION_S,
    HUNG_AFTER,
    OSRS,
    REPEATS,
    Ms5837,
    Ms5837Knobs,
    Prom,
    _second_order_02,
    _second_order_30,
    compensate,
    crc4,
    model_of,
    reading_of,
)

CASES = yaml.safe_load(Path(__file__).with_name("cases.yaml").read_text())
EXAMPLE = CASES["compensation"][0]
WORDS = [bytes.fromhex(word) for word in CASES["prom"][0]["words"].split()]


@pytest.mark.parametrize("row", CASES["compensation"], ids=lambda row: row["model"])
def test_the_worked_example(row: dict[str, Any]) -> None:
    prom = Prom(row["model"], tuple(row["c"]))
    assert compensate(prom, row["d1"], row["d2"]) == (row["temperature_cC"], row["steps"])
    assert astuple(reading_of(prom, row["d1"], row["d2"])) == (
        row["pressure_Pa"],
        pytest.approx(row["temperature_cC"] / 100.0),
    )


@pytest.mark.parametrize(
    ("second_order", "dt", "temperature_cC", "wanted"),
    [
        (_second_order_30, 2**20, 2000, (16, 0, 0)),
        (_second_order_30, 2**20, 2400, (16, 10_000, 0)),
        (_second_order_30, -(2**20), 1600, (384, 240_000, 100_000)),
        (_second_order_30, -(2**20), -1500, (384, 18_375_000, 7_656_250)),
        (_second_order_30, -(2**20), -2500, (384, 37_375_000, 16_656_250)),
        (_second_order_02, 2**20, 2000, (0, 0, 0)),
        (_second_order_02, -(2**20), 1600, (352, 620_000, 315_000)),
    ],
)
def test_the_second_order_in_each_range_of_the_temperature(
    second_order: Callable[[int, int], tuple[int, int, int]], dt: int, temperature_cC: int, wanted: tuple[int, int, int]
) -> None:
    """Ti, OFFi and SENSi by hand from the formulas (30BA page 11, 02BA page 9)."""
    assert second_order(dt, temperature_cC) == wanted


@pytest.mark.parametrize("row", CASES["prom"], ids=lambda row: row["words"][:4])
def test_checksum_and_model_of_a_prom(row: dict[str, Any]) -> None:
    words = [int(word, 16) for word in row["words"].split()]
    assert crc4(words) == words[0] >> 12 == row["crc"]
    assert model_of(words[1]) == row["model"]


@pytest.mark.parametrize(("c1", "model"), CASES["variants"].items())
def test_models_are_distinguished_by_c1(c1: int, model: str | None) -> None:
    assert model_of(c1) == model


@pytest.mark.parametrize("osr", OSRS)
def test_no_conversion_is_read_before_its_longest_time(osr: str) -> None:
    assert CONVERSION_S[OSRS.index(osr)] > CASES["longest_s"][int(osr)]


def configuration(words: list[bytes]) -> list[tuple[Operation, bytes]]:
    first = int(CASES["prom_first"], 16)
    return [
        (Write(0x76, bytes.fromhex(CASES["reset"])), b""),
        (Pause(0.01), b""),
        *((WriteRead(0x76, bytes([first + 2 * index]), 2), word) for index, word in enumerate(words)),
    ]


def conversion(command: str, wait_s: float, answer: str, slack_s: float = 0.0) -> list[tuple[Operation, bytes]]:
    return [
        (Write(0x76, bytes.fromhex(command)), b""),
        (Pause(wait_s, slack_s), b""),
        (WriteRead(0x76, bytes.fromhex("00"), 3), bytes.fromhex(answer)),
    ]


def test_configuration_and_first_reading_are_the_data_sheets() -> None:
    sensor = Ms5837(Ms5837Knobs(oversampling="8192"))
    identity = rehearse(sensor.configure(), configuration(WORDS))
    assert identity.text == "MS5837-30BA at 0x76, C1 34982"
    d2 = conversion("5a", CONVERSION_S[5], EXAMPLE["d2"].to_bytes(3, "big").hex())
    d1 = conversion(CASES["convert_d1_8192"], CONVERSION_S[5], CASES["d1_bytes"])
    (reading,) = rehearse(sensor.cycle(Stamp(0)), d2 + d1)
    assert isinstance(reading, Stamped)
    assert isinstance(reading.reading, Pressure)
    assert astuple(reading) == (30_750_000, (399980.0, pytest.approx(19.81)))


def test_the_temperature_is_converted_every_tenth_time() -> None:
    sensor = Ms5837()
    rehearse(sensor.configure(), configuration(WORDS))
    d2 = conversion("58", CONVERSION_S[4], EXAMPLE["d2"].to_bytes(3, "big").hex())
    for turn in range(20):
        both = turn % 10 == 0
        left_s = 0.0 if both else 0.02 - CONVERSION_S[4]
        d1 = conversion("48", CONVERSION_S[4], f"4ba7{turn:02x}", left_s)
        rehearse(sensor.cycle(Stamp(turn)), d2 + d1 if both else d1)


def test_a_wrong_checksum_names_both() -> None:
    words = [WORDS[0], b"\x88\xa7", *WORDS[2:]]
    with pytest.raises(DeviceError, match=r"address 0x76: PROM checksum 0x[0-9a-f], wanted 0x9"):
        rehearse(Ms5837().configure(), configuration(words))


def test_a_silent_prom_is_refused_though_its_checksum_holds() -> None:
    assert crc4([0] * 7) == 0
    with pytest.raises(DeviceError, match="PROM"):
        rehearse(Ms5837().configure(), configuration([b"\0\0"] * 7))


def test_a_conversion_that_gives_zero_was_read_early_or_lost() -> None:
    sensor = Ms5837()
    rehearse(sensor.configure(), configuration(WORDS))
    with pytest.raises(DeviceError, match="gave 0"):
        rehearse(sensor.cycle(Stamp(0)), conversion("58", CONVERSION_S[4], "000000"))


def test_the_model_may_be_ordered_and_a_contradiction_is_remarked() -> None:
    sensor = Ms5837(Ms5837Knobs(model="02BA"))
    identity = rehearse(sensor.configure(), configuration(WORDS))
    assert identity.text == "MS5837-02BA at 0x76, C1 34982 (its calibration looks like 30BA)"


def test_a_30ba_may_be_ordered_where_the_calibration_looks_like_the_other() -> None:
    words = [bytes.fromhex(word) for word in CASES["prom"][2]["words"].split()]
    identity = rehearse(Ms5837(Ms5837Knobs(model="30BA")).configure(), configuration(words))
    assert identity.text == "MS5837-30BA at 0x76, C1 46372 (its calibration looks like 02BA)"


def test_the_model_is_reported_by_the_first_coefficient_whatever_the_second_is() -> None:
    first, *others = (0, 34982, 45000, 20328, 22354, 26646, 26146)
    words = [first | crc4([first, *others]) << 12, *others]
    identity = rehearse(Ms5837().configure(), configuration([word.to_bytes(2, "big") for word in words]))
    assert identity.text == "MS5837-30BA at 0x76, C1 34982"


def converted(sensor: Ms5837, turn: int, d1: int, d2: int = EXAMPLE["d2"]) -> tuple[list[Any], list[int]]:
    """Outputs of one cycle at 50 Hz in which the sensor converts to these numbers, and the commands that it got."""
    commands: list[int] = []
    program = sensor.cycle(stamp_from_s(1.0 + 0.02 * turn))
    try:
        operation = next(program)
        while True:
            if isinstance(operation, Write):
                commands.append(operation.data[0])
            temperature = bool(commands) and commands[-1] >= 0x50
            answer = (d2 if temperature else d1).to_bytes(3, "big") if isinstance(operation, WriteRead) else b""
            operation = program.send(answer)
    except StopIteration as stop:
        return list(stop.value), commands


def ready() -> Ms5837:
    sensor = Ms5837()
    rehearse(sensor.configure(), configuration(WORDS))
    return sensor


@pytest.mark.parametrize(
    ("d1", "d2", "what"),
    [
        (1, EXAMPLE["d2"], "Pa is outside the range of an MS5837-30BA"),
        (0xFFFFFF, EXAMPLE["d2"], "Pa is outside the range of an MS5837-30BA"),
        (EXAMPLE["d1"], 0x400000, "C is outside the range of an MS5837-30BA"),
        (EXAMPLE["d1"], 0x8F0000, "C is outside the range of an MS5837-30BA"),
    ],
)
def test_what_the_part_cannot_measure_is_refused_and_the_temperature_converted_anew(
    d1: int, d2: int, what: str
) -> None:
    sensor = ready()
    ((refused,), _) = converted(sensor, 0, d1, d2)
    assert isinstance(refused, Rejected)
    assert what in refused.reason
    assert refused.data == d1.to_bytes(3, "big") + d2.to_bytes(3, "big")
    ((good,), commands) = converted(sensor, 1, EXAMPLE["d1"])
    assert isinstance(good.reading, Pressure)
    assert astuple(good.reading) == (399980.0, pytest.approx(19.81))
    assert commands == [0x58, 0x48]


def test_a_converter_that_gives_the_same_again_and_again_is_refused_and_in_the_end_configured_anew() -> None:
    sensor = ready()
    for turn in range(REPEATS):
        ((accepted,), _) = converted(sensor, turn, EXAMPLE["d1"])
        assert isinstance(accepted, Stamped)
    ((refused,), _) = converted(sensor, REPEATS, EXAMPLE["d1"])
    assert refused.reason == f"{REPEATS + 1} equal conversions"
    ((accepted,), _) = converted(sensor, REPEATS + 1, EXAMPLE["d1"] + 1)
    assert isinstance(accepted, Stamped), "it lives"
    for turn in range(HUNG_AFTER):
        converted(sensor, REPEATS + 2 + turn, EXAMPLE["d1"] + 1)
    with pytest.raises(DeviceError, match="repeats the same conversion"):
        converted(sensor, REPEATS + 2 + HUNG_AFTER, EXAMPLE["d1"] + 1)
    rehearse(sensor.configure(), configuration(WORDS))
    ((accepted,), commands) = converted(sensor, 100, EXAMPLE["d1"])
    assert isinstance(accepted, Stamped)
    assert commands == [0x58, 0x48]
