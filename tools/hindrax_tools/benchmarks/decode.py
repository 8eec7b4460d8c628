"""Speed of decoding a DVL's sentences, beside pynmea2 on the same lines."""

from collections.abc import Callable
from functools import reduce
from itertools import cycle
from operator import xor

import pynmea2

from hindrax_core.events import Stamp
from hindrax_drivers.devices.dvl75 import Dvl75
from hindrax_drivers.protocols.dvl75_protocol import position_delta, split_verified
from hindrax_tools.benchmarks import interleaved_us, row

LINES = 1000
SPAN = 20
PASSES = 15
INTERVAL_us = 50_000
PEER = f"pynmea2 {pynmea2.__version__}"
DELTA_BODY = "DVPDL,{},50000,0.000000,-0.000000,-0.000000,-0.003,0.017,0.002,100"
EXTENDED_BODY = (
    "DVEXT,T,X,0310,89.9,69.3,290.9,{},-0.067,0.35,-0.144,0.295,-0.000427010,0.001465353,0.050,0.500257,-0.290460,"
    "0.644365,0.500170,19,19,48,25,T,T,F,T,-0.0086,-0.0169,0.0000,-0.0608,0.371,0.391,-1.000,0.371,"
)
EXTENDED_WORDS = (1, 2, 3, 23, 24, 25, 26, 35)
EXTENDED_NAMES = tuple(f"f{index}" for index in range(1, 35))


class PDL(pynmea2.TalkerSentence):  # type: ignore[misc]  # pynmea2 has no types
    """What pynmea2 needs to know of the sentence: it finds classes by their name."""

    fields = tuple(
        (name, name, int if name in ("tu", "dtu", "c") else float)
        for name in ("tu", "dtu", "adr", "adp", "ady", "pdx", "pdy", "pdz", "c")
    )


class EXT(pynmea2.TalkerSentence):  # type: ignore[misc]  # pynmea2 has no types
    """The longer sentence: 34 values and an empty one; flags and the calibration digits are words."""

    fields = tuple((f"f{i}", f"f{i}", str if i in EXTENDED_WORDS else float) for i in range(1, 36))


def rows() -> list[dict[str, object]]:
    """One row per figure and peer: name, ours_us, peer, peer_us, ratio. Medians over interleaved spans of lines."""
    deltas, tracks = _lines(DELTA_BODY), _lines(EXTENDED_BODY)
    numbers = "$DVPDL, checksum verified, to numbers"
    reading = "$DVPDL, bytes to stamped reading, whole driver"
    track = "$DVEXT, bytes to stamped reading, whole driver"
    return [
        _figure(numbers, _decode, deltas, f"{PEER}, to numbers", _peer_numbers),
        _figure(numbers, _decode, deltas, f"{PEER}, values left as text", _peer_text),
        _figure(reading, _driver(), deltas, f"{PEER}, to numbers", _peer_numbers),
        _figure(track, _driver(), tracks, f"{PEER}, to numbers", _peer_track),
    ]


def _lines(body: str) -> list[bytes]:
    bodies = (body.format(1_398_604_000 + index * INTERVAL_us).encode() for index in range(LINES))
    return [b"$%s*%02X\r\n" % (one, reduce(xor, one)) for one in bodies]


def _decode(line: bytes) -> object:
    return position_delta(split_verified(line[:-2]))


def _driver() -> Callable[[bytes], object]:
    """A driver that receives a line every 50 ms; its clock restarts with the lines."""
    driver = Dvl75()
    driver.start(Stamp(0))
    arrivals = (Stamp(arrival) for arrival in cycle(range(0, LINES * INTERVAL_us * 1000, INTERVAL_us * 1000)))
    return lambda line: driver.feed(line, next(arrivals))


def _peer_text(line: bytes) -> object:
    return pynmea2.parse(line.decode("ascii"), check=True)


def _peer_numbers(line: bytes) -> object:
    found = pynmea2.parse(line.decode("ascii"), check=True)
    return (found.tu, found.dtu, found.adr, found.adp, found.ady, found.pdx, found.pdy, found.pdz, found.c)


def _peer_track(line: bytes) -> object:
    found = pynmea2.parse(line.decode("ascii"), check=True)
    return [getattr(found, name) for name in EXTENDED_NAMES]


def _figure(
    name: str, ours: Callable[[bytes], object], lines: list[bytes], peer: str, theirs: Callable[[bytes], object]
) -> dict[str, object]:
    def over(call: Callable[[bytes], object]) -> Callable[[], object]:
        spans = cycle([lines[at : at + SPAN] for at in range(0, LINES, SPAN)])
        return lambda: [call(line) for line in next(spans)]

    ours_us, peer_us = interleaved_us((over(ours), over(theirs)), PASSES * LINES // SPAN)
    return row(name, ours_us / SPAN, peer, peer_us / SPAN)
