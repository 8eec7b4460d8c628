"""Laws of the stream decoders, on four hundred thousand random and mutated frames each."""

import functools
import operator
import random
import re
import struct
from collections.abc import Callable, Iterable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from property.flood import FRAMES, chunked, flood, mutate

from hindrax_core.driver_interface import Output
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.readings import BottomTrack, BottomVelocity, Echo, EchoProfile
from hindrax_core.testing import chunks
from hindrax_drivers.devices.dvl75 import Dvl75
from hindrax_drivers.devices.dvl75_settings import Dvl75Knobs
from hindrax_drivers.devices.ping1d import Ping1d
from hindrax_drivers.devices.ping1d_settings import Ping1dKnobs
from hindrax_drivers.protocols import ping_protocol as protocol
from hindrax_drivers.protocols.ping_protocol import encode

SENTENCE_MARKS = (b"$", b"\n", b"*", b",", b"\x00")
FRAME_MARKS = (b"B", b"BR", b"R", b"\x00")


def xor(body: bytes) -> int:
    return functools.reduce(operator.xor, body, 0)


def sentence(body: str) -> bytes:
    return b"$%s*%02X\r\n" % (body.encode(), xor(body.encode()))


def dvl_frame(dice: random.Random) -> bytes:
    """A good sentence of a random kind, with numbers that need not be good."""
    numbers = ",".join(f"{dice.uniform(-0.3, 0.3):.3f}" for _ in range(6))
    tu, span = dice.randrange(10**12), dice.choice([50_000, 100_000, 200_000, 0, 7])
    confidence = dice.choice([100, 100, 100, 0, 50, 1000])
    angles = f"{dice.uniform(-200, 200):.1f},{dice.uniform(-90, 90):.1f},{dice.uniform(0, 370):.1f}"
    beams = "19,19,48,25,T,T,F,T,-0.0086,-0.0169,0.0000,-0.0608,0.371,0.391,-1.000,0.371,"
    extended = (
        f"DVEXT,{dice.choice('TF')},X,0310,{angles},{dice.randrange(-2000, 9)},-0.1,0.35,0.1,0.2,0,0,0.05,1,0,0,0"
    )
    return dice.choice(
        [
            sentence(f"DVPDL,{tu},{span},{numbers},{confidence}"),
            sentence(f"DVPDX,{tu},{span},{numbers},{confidence},1,0.5,-0.5,{dice.uniform(0, 9):.3f}"),
            sentence(f"{extended},{beams}"),
            sentence("DVKFA,15,7,0.05,1,2"),
            sentence("DVTXT,all is well"),
            b"$DVTXT,no checksum\r\n",
            b"booting\r\n",
            b"IMU:1,0,0,0,0,0,0,0,0,0,0.05\r\n",
        ]
    )


def ping_frame(dice: random.Random) -> bytes:
    """A good frame of a random kind, with numbers that need not be good."""
    strength = dice.randbytes(dice.choice([0, 4, 200]))
    numbers = (dice.randrange(9), dice.randrange(200), dice.randrange(10_000), 2)
    head = struct.pack("<IHHIIII", dice.randrange(9000), dice.choice([100, 90, 0, 999]), 52, *numbers)
    return dice.choice(
        [
            encode(protocol.DISTANCE, head),
            encode(protocol.PROFILE, head + struct.pack("<H", len(strength)) + strength),
            encode(protocol.PROFILE, head + struct.pack("<H", 3) + strength),
            encode(protocol.DISTANCE_SIMPLE, struct.pack("<IB", dice.randrange(9000), dice.randrange(256))),
            encode(protocol.ACK, struct.pack("<H", dice.randrange(1400))),
            encode(protocol.NACK, struct.pack("<H", dice.randrange(1400)) + b"no"),
            encode(protocol.TEXT, b"hi"),
            encode(protocol.DEVICE_INFORMATION, bytes([1, 2, 3, 28, 0, 0])),
            encode(dice.randrange(65536), dice.randbytes(dice.randrange(40))),
        ]
    )


def fed(driver: Dvl75 | Ping1d, data: bytes, dice: random.Random) -> list[Any]:
    return [one for chunk in chunked(data, dice) for one in driver.feed(chunk, Stamp(10**9))]


def readings(outputs: Iterable[Output], *kinds: type) -> list[Any]:
    return [one.reading for one in outputs if isinstance(one, Stamped) and isinstance(one.reading, kinds)]


def true_sentences(data: bytes) -> list[bytes]:
    """Sentences whose checksum holds, found without the decoder."""
    found = re.findall(rb"\$([^$\n]*)\*([0-9A-Fa-f]{2})(?=\r*(?:[\n$]|\Z))", data)
    return [body for body, digits in found if xor(body) == int(digits, 16)]


def test_a_flood_of_sentences_raises_nothing_and_lets_no_false_one_through() -> None:
    dice = random.Random(75)
    driver = Dvl75(Dvl75Knobs(min_confidence=0.01))
    accepted = 0
    for batch in flood(dvl_frame, SENTENCE_MARKS, dice):
        data = batch + b"\n"
        outputs = fed(driver, data, dice)
        true = true_sentences(data)
        times = {body.split(b",")[1] for body in true if body.startswith((b"DVPDL,", b"DVPDX,"))}
        velocities = readings(outputs, BottomVelocity)
        assert {b"%d" % one.device_us for one in velocities} <= {time.lstrip(b"0+") or b"0" for time in times}
        assert len(readings(outputs, BottomTrack)) <= sum(body.startswith(b"DVEXT,") for body in true)
        assert len(readings(outputs, Echo)) <= sum(body.startswith(b"DVPDX,") for body in true)
        assert all(abs(part) <= 5.0 for one in velocities if one.velocity_mps for part in one.velocity_mps)
        accepted += len(velocities)
    assert accepted > FRAMES // 40, "the flood must not drown everything"


def true_frames(data: bytes) -> set[tuple[int, bytes]]:
    """Frames whose sum holds, at any place, found without the decoder."""
    found = set()
    for start in (match.start() for match in re.finditer(b"BR", data)):
        length, message = struct.unpack_from("<HH", data.ljust(start + 8, b"\0"), start + 2)
        end = start + 8 + length
        if end + 2 <= len(data) and sum(data[start:end]) & 0xFFFF == int.from_bytes(data[end : end + 2], "little"):
            found.add((message, data[start + 8 : end]))
    return found


def running_ping() -> Ping1d:
    driver = Ping1d(Ping1dKnobs(tries=1, answer_s=0.05, continuous=False, min_confidence=0.0, profile=True))
    driver.start(Stamp(0))
    driver.feed(encode(protocol.DEVICE_INFORMATION, bytes([1, 2, 3, 28, 0, 0])), Stamp(0))
    for index in range(1, 10):
        driver.tick(Stamp(index * 50_000_000))
    assert driver.ready
    return driver


def test_a_flood_of_frames_raises_nothing_and_lets_no_false_one_through() -> None:
    dice = random.Random(1)
    accepted = 0
    # Few at a time: a ping number that goes back is a restart, after which nothing is believed until it is set up.
    for data in flood(ping_frame, FRAME_MARKS, dice, batch=50):
        driver = running_ping()
        outputs = fed(driver, data, dice)
        true = true_frames(data)
        payloads = [payload for message, payload in true if message in (1211, 1212, 1300)]
        distances = {int.from_bytes(payload[:4], "little") for payload in payloads}
        echoes = readings(outputs, Echo)
        assert {round(one.range_m * 1000) for one in echoes} <= distances
        strengths = {payload[26:] for message, payload in true if message == 1300}
        assert {one.strength for one in readings(outputs, EchoProfile)} <= strengths
        accepted += len(echoes)
    assert accepted > FRAMES // 200, "the flood must not drown everything"


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32),
    st.lists(st.integers(1, 300), min_size=1, max_size=10),
    st.sampled_from([(Dvl75, dvl_frame, SENTENCE_MARKS), (running_ping, ping_frame, FRAME_MARKS)]),
)
def test_any_chunking_gives_the_same_events(seed: int, sizes: list[int], device: Any) -> None:
    make, frame, marks = device
    dice = random.Random(seed)
    data = b"".join(mutate(frame(dice), marks, dice) for _ in range(20))
    whole = make().feed(data, Stamp(10**9))
    driver = make()
    parts = [one for chunk in chunks(data, sizes) for one in driver.feed(chunk, Stamp(10**9))]
    # Troubles of the clock come at the end of a chunk; readings and refusals come in the order of the bytes.
    kinds = (Stamped, Rejected)
    assert [one for one in parts if isinstance(one, kinds)] == [one for one in whole if isinstance(one, kinds)]
    assert sorted(map(repr, parts)) == sorted(map(repr, whole))


@pytest.mark.parametrize("make", [Dvl75, running_ping])
@given(data=st.binary(max_size=3000))
@settings(max_examples=60, deadline=None)
def test_bytes_that_mean_nothing_give_no_measurement(make: type[Dvl75] | Callable[[], Ping1d], data: bytes) -> None:
    assert readings(make().feed(data, Stamp(0)), BottomVelocity, BottomTrack, Echo, EchoProfile) == []
