"""Laws of the MAVLink decoders, of host and firmware, over four hundred thousand random and mutated frames."""

import random
import struct

from property.flood import FRAMES, chunked, flood
from pymavlink.dialects.v20 import common
from pymavlink.generator.mavcrc import x25crc

from hindrax_core.events import Stamp
from hindrax_drivers.devices.stm32 import Stm32
from hindrax_drivers.protocols.mavlink import Decoder, MavlinkFrame
from hindrax_sim.firmware.controller import Controller
from hindrax_sim.firmware.mavlink import RECEIVED

HOST_EVERY = 10
"""The driver of the host is the decoder and a little more; every so many batches are enough for the rest."""
MARKS = (b"\xfd", b"\xfe", b"\x00", b"\xff")
KNOWN = (0, 36, 70, 76, 77, 147, 253)
EXTRA = {number: common.mavlink_map[number].crc_extra for number in KNOWN}
LONGEST = {number: struct.calcsize(common.mavlink_map[number].unpacker.format) for number in KNOWN}


def frame(dice: random.Random) -> bytes:
    """A good frame of a random kind, from either end."""
    pulses = [dice.choice([1500, 1100, 1900, 0, 65535, dice.randrange(65536)]) for _ in range(16)]
    cells = [dice.randrange(60_000), *[65535] * 9]
    end = common.MAVLink(None, srcSystem=1, srcComponent=dice.choice([1, 191]))
    end.seq = dice.randrange(256)
    message = dice.choice(
        [
            end.heartbeat_encode(12, 0, dice.choice([0, 128]), 0, dice.randrange(9)),
            end.servo_output_raw_encode(dice.randrange(2**32), 0, *pulses),
            end.rc_channels_override_encode(1, 1, *pulses),
            end.command_long_encode(
                *(1, 1, dice.choice([400, 400, 246]), 0, dice.choice([0.0, 1.0, float("nan")])), *(0.0,) * 6
            ),
            end.command_ack_encode(400, dice.randrange(6)),
            end.battery_status_encode(0, 0, 0, 0x7FFF, cells, dice.choice([-1, 300]), -1, -1, -1),
            end.statustext_encode(dice.randrange(8), "text \ufffd".encode()),
        ]
    )
    return bytes(message.pack(end))


def true_frames(data: bytes) -> int:
    """Frames whose checksum holds, at any place, found without the decoder and with pymavlink's checksum."""
    found = 0
    for start in (at for at, byte in enumerate(data) if byte == 0xFD):
        head = data[start : start + 10]
        number = int.from_bytes(head[7:10], "little")
        if len(head) < 10 or head[2] or number not in EXTRA or not 0 < head[1] <= LONGEST[number]:
            continue
        end = start + 10 + head[1]
        crc = x25crc(data[start + 1 : end])
        crc.accumulate(bytes([EXTRA[number]]))
        found += len(data) >= end + 2 and crc.crc == int.from_bytes(data[end : end + 2], "little")
    return found


def test_a_flood_of_frames_raises_nothing_and_lets_no_false_one_through() -> None:
    dice = random.Random(407)
    host, board, accepted = Stm32(range(8)), Controller(8, 0, 0), 0
    for turn, batch in enumerate(flood(frame, MARKS, dice)):
        data, decoder = batch + bytes(300), Decoder()
        found = 0
        for piece in chunked(data, dice):
            found += sum(isinstance(event, MavlinkFrame) for event in decoder.feed(piece, Stamp(turn)))
            board.receive(piece, turn)
            assert all(1100 <= pulse <= 1900 for pulse in board.failsafe.step(turn))
            if turn % HOST_EVERY == 0:
                list(host.feed(piece, Stamp(turn)))
        assert found <= true_frames(data)
        accepted += found
    assert accepted > FRAMES // 3, "the flood must not drown everything"


def test_the_firmware_receives_with_the_lengths_of_the_message_set() -> None:
    assert {number: LONGEST[number] for number in RECEIVED} == RECEIVED
