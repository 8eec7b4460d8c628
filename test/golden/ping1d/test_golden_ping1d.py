"""Frames from outside through the codec and the driver."""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
import yaml

from hindrax_core.driver_interface import Identity, Output, Send
from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import Echo, EchoProfile
from hindrax_drivers.devices.ping1d import Ping1d
from hindrax_drivers.devices.ping1d_settings import Ping1dKnobs
from hindrax_drivers.protocols import ping_protocol as protocol

CASES = yaml.safe_load((Path(__file__).parent / "cases.yaml").read_text(encoding="utf-8"))
FRAMES = {case["name"]: bytes.fromhex(case["frame"]) for case in CASES["host"] + CASES["device"]}


def named(kind: str) -> list[object]:
    return [pytest.param(case, id=case["name"]) for case in CASES[kind]]


@pytest.mark.parametrize("case", named("host") + named("device"))
def test_encoding(case: dict[str, Any]) -> None:
    assert protocol.encode(case["message"], bytes.fromhex(case["payload"])) == bytes.fromhex(case["frame"])


@pytest.mark.parametrize("case", named("device"))
def test_decoding(case: dict[str, Any]) -> None:
    wanted = protocol.PingFrame(case["message"], bytes.fromhex(case["payload"]))
    assert protocol.FrameSplitter().feed(bytes.fromhex(case["frame"])) == [wanted]


@pytest.mark.parametrize("case", named("hostile"))
def test_hostile_streams_swallow_nothing(case: dict[str, Any]) -> None:
    stream = bytes.fromhex(case["stream"].replace("F", FRAMES["distance_simple"].hex(" ")))
    pieces = protocol.FrameSplitter().feed(stream)
    assert [one.id for one in pieces if isinstance(one, protocol.PingFrame)] == [1211] * case["wanted"]
    assert any(isinstance(one, protocol.Refused) for one in pieces)


def running() -> tuple[Ping1d, list[Output]]:
    """A driver whose device acknowledges nothing and has just sent its identity; orders are given up one by one."""
    driver = Ping1d(Ping1dKnobs(tries=1, answer_s=0.05, continuous=False, profile=True))
    outputs = [*driver.start(Stamp(0)), *driver.feed(FRAMES["device_information"], Stamp(0))]
    for index in range(1, 20):
        outputs += driver.tick(Stamp(index * 50_000_000))
    assert driver.ready
    return driver, outputs


def test_the_identity() -> None:
    _, outputs = running()
    assert [one.text for one in outputs if isinstance(one, Identity)] == [
        CASES["readings"]["device_information"]["text"]
    ]
    assert outputs[0] == Send(protocol.request(5) + protocol.request(4), wake=True)


@pytest.mark.parametrize("name", ["distance_simple", "distance", "profile"])
def test_readings(name: str) -> None:
    driver, _ = running()
    found = [one.reading for one in driver.feed(FRAMES[name], Stamp(10**9)) if isinstance(one, Stamped)]
    wanted = dict(CASES["readings"][name])
    assert [type(one) for one in found] == ([Echo, EchoProfile] if name == "profile" else [Echo])
    if "strength" in wanted:
        wanted["strength"] = bytes.fromhex(wanted["strength"])
    assert asdict(found[-1]) == pytest.approx(wanted)


def test_supply_and_temperatures() -> None:
    driver, _ = running()
    wanted = dict(CASES["health"])
    data = b"".join(FRAMES[name] for name in wanted.pop("frames"))
    (found,) = [one.reading for one in driver.feed(data, Stamp(10**9)) if isinstance(one, Stamped)]
    assert asdict(found) == pytest.approx(wanted)
