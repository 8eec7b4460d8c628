"""Guard and allocation over a bag that was flown by hand, beyond limits and with a thruster out of use."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from hindrax_bag.message_comparison import Difference
from hindrax_bag.read.recovery import recover
from hindrax_bringup.clone import clone_root
from hindrax_control.allocation import allocation_cycle, wrench_guard
from hindrax_control.allocation.allocator import Allocator
from hindrax_control.allocation.thrust_curve import AppliedWrench
from hindrax_core.readings import Vec6
from hindrax_core.signals import Allocation
from hindrax_core.text.refusals import Reason, Refusal
from hindrax_core.topics import ALLOCATION, THRUSTER_COMMAND, WRENCH, resolved
from hindrax_replay.bag_replay import replay

BY_HAND = clone_root() / "test" / "replay" / "bags" / "by_hand_at_limits"
COMMAND_NAME, STATUS_NAME = resolved(THRUSTER_COMMAND), resolved(ALLOCATION)


def differences(bag: Path = BY_HAND) -> list[Difference]:
    return replay(bag).ledger.differences()


def fields(found: list[Difference], topic: str) -> set[str]:
    return {one.field.partition("[")[0] for one in found if one.topic == topic}


def test_every_wrench_gives_the_command_that_it_gave() -> None:
    ledger = replay(BY_HAND).ledger
    assert ledger.differences() == []
    assert ledger.messages[COMMAND_NAME] > 1000
    assert ledger.messages[STATUS_NAME] > 1000


def test_a_guard_with_other_limits_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    real = wrench_guard._limited
    monkeypatch.setattr(
        wrench_guard, "_limited", lambda wrench, limits: real(wrench, tuple(0.5 * one for one in limits))
    )
    found = differences()
    assert fields(found, COMMAND_NAME) == {"pulses"}
    assert "refused" in fields(found, STATUS_NAME)


def test_a_guard_that_refuses_everything_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    refusal = Refusal(Reason.LATE, "wrench: refused")
    monkeypatch.setattr(wrench_guard.WrenchGuard, "_out_of_time", lambda *_: refusal)
    assert fields(differences(), COMMAND_NAME) == {"(message) recorded, not replayed"}


def test_another_allocation_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    class Other(Allocator):
        def allocate(self, *words: Any, **named: Any) -> Allocation:
            plan = super().allocate(*words, **named)
            return dataclasses.replace(plan, pulses_us=(plan.pulses_us[0] + 1, *plan.pulses_us[1:]))

    monkeypatch.setattr(allocation_cycle, "Allocator", Other)
    found = differences()
    assert {(one.topic, one.field) for one in found} == {(COMMAND_NAME, "pulses[0]")}


def test_another_reckoning_of_what_was_achieved_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    class Other(AppliedWrench):
        def wrench(self, forces_N: Sequence[float]) -> Vec6:
            X, Y, Z, K, M, N = super().wrench(forces_N)
            return (X + 0.001, Y, Z, K, M, N)

    monkeypatch.setattr(allocation_cycle, "AppliedWrench", Other)
    assert {(one.topic, one.field) for one in differences()} == {
        (STATUS_NAME, "achieved[0]"),
        (STATUS_NAME, "shortfall[0]"),
    }


def test_a_wrench_that_was_not_served_is_found(tmp_path: Path) -> None:
    def kept(topic: str, after_s: float) -> bool:
        return topic != COMMAND_NAME or not 10.0 < after_s < 11.0

    found = differences(recover(BY_HAND, tmp_path / "silent", keep=kept).output)
    assert fields(found, COMMAND_NAME) == {"(message) replayed, not recorded"}
    assert 40 < found[0].count < 60


def test_without_wrenches_what_was_achieved_is_compared_still(tmp_path: Path) -> None:
    without = {COMMAND_NAME, resolved(WRENCH)}
    bag = recover(BY_HAND, tmp_path / "without", keep=lambda topic, _: topic not in without).output
    ledger = replay(bag).ledger
    assert ledger.differences() == []
    assert COMMAND_NAME not in ledger.messages
    assert ledger.messages[STATUS_NAME] > 1000
