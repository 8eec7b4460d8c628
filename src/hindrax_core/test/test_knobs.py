"""Declared once, checked everywhere: errors name the key path, what was found and what was wanted."""

from dataclasses import dataclass, field, fields
from typing import Any

import pytest

from hindrax_core.errors import UsageError
from hindrax_core.knobs import build, choice, fact, knob, knob_of


@dataclass(frozen=True, slots=True)
class Inner:
    gain: float = knob(1.0, 0.0, 2.0, "gain [-]")
    place: tuple[float, float, float] = knob((0.0, 0.0, 0.0), -9.0, 9.0, "place [m]")


@dataclass(frozen=True, slots=True)
class Outer:
    mass_kg: float = fact(0.1, 100.0, "mass [kg]")
    count: int = knob(3, 1, 8, "count [-]")
    mode: str = choice("fast", ("fast", "slow"), "mode")
    inner: Inner = field(default_factory=Inner)
    many: tuple[Inner, ...] = ()
    named: dict[str, Inner] = field(default_factory=dict)
    maybe: float | None = None
    on: bool = False


def test_defaults_and_values() -> None:
    built = build(Outer, {"mass_kg": 2, "many": [{"gain": 0.5}], "named": {"a": {}}, "maybe": 1.5}, "file")
    assert built.mass_kg == 2.0
    assert isinstance(built.mass_kg, float)
    assert built.many == (Inner(gain=0.5),)
    assert built.named == {"a": Inner()}
    assert built.maybe == 1.5


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        ({}, "file.mass_kg: missing, wanted mass"),
        ({"mass_kg": "heavy"}, "file.mass_kg: found 'heavy', wanted a number"),
        ({"mass_kg": True}, "file.mass_kg: found True, wanted a number"),
        ({"mass_kg": 1000.0}, "file.mass_kg: found 1000, wanted 0.1 to 100"),
        ({"mass_kg": float("nan")}, "file.mass_kg: found nan, wanted 0.1 to 100"),
        ({"mass_kg": 1, "count": 1.5}, "file.count: found 1.5, wanted a whole number"),
        ({"mass_kg": 1, "mode": "mad"}, "file.mode: found 'mad', wanted one of fast, slow"),
        ({"mass_kg": 1, "inner": {"place": [1, 2]}}, "file.inner.place: found 2 values, wanted 3"),
        ({"mass_kg": 1, "inner": {"place": [1, 2, 99]}}, r"file.inner.place\[2\]: found 99, wanted -9 to 9"),
        ({"mass_kg": 1, "inner": {"place": "far"}}, "file.inner.place: found 'far', wanted a list"),
        ({"mass_kg": 1, "inner": 3}, "file.inner: found 3, wanted a block of keys"),
        ({"mass_kg": 1, "named": [1]}, r"file.named: found \[1\], wanted a block of names"),
        ({"mass_kg": 1, "named": {"a": {"gian": 1}}}, "file.named.a.gian: unknown key, wanted one of gain, place"),
        ([], r"file: found \[\], wanted a block of keys"),
        (None, "file: found nothing, wanted a block of keys"),
        ("0.1,2.3 " * 1000, r"file: found '0.1,2.3 .{1,60}\.\.\., wanted a block of keys"),
    ],
)
def test_errors_name_the_key_path(data: dict[str, Any], sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        build(Outer, data, "file")


def test_a_knob_knows_its_unit() -> None:
    declared = {one.name: knob_of(one) for one in fields(Outer)}
    assert declared["mass_kg"].unit == "kg"
    assert declared["mode"].unit == ""
    assert declared["on"].meaning == ""


@pytest.mark.parametrize(
    ("data", "sentence"),
    [({}, "^/a/b.yaml: mass_kg: missing"), ([], r"^/a/b.yaml: found \[\], wanted a block of keys")],
)
def test_the_keys_of_a_file_stand_apart_from_its_name(data: Any, sentence: str) -> None:
    with pytest.raises(UsageError, match=sentence):
        build(Outer, data, "/a/b.yaml:")
