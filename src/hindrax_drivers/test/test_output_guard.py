"""The output guard: examples of each rule, and a machine that tries to get a pulse out that must not be."""

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp, after, seconds_between, stamp_from_s
from hindrax_core.signals import Command
from hindrax_core.text.refusals import Reason, Refusal
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_drivers.output.output_guard import (
    Answer,
    ArmingPhase,
    CommandFault,
    OutputGuard,
    OutputGuardKnobs,
    OutputGuardState,
    Pulses,
    RefusedCommand,
    Request,
    guard_of,
)
from hindrax_drivers.output.output_reasons import OutputReason, output_reason

KNOBS = OutputGuardKnobs()
GUARD = OutputGuard((1500.0,) * 8, lights=2, knobs=KNOBS)
VEHICLE = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
NEUTRAL = (1500.0,) * 8
FULL = (1900.0,) * 8
EPOCH_S = 1000.0


def at(seconds: float) -> Stamp:
    return stamp_from_s(EPOCH_S + seconds)


def command(seconds: float, sequence: int, pulses: tuple[float, ...] = FULL, lights: tuple[float, ...] = ()) -> Command:
    return Command(pulses, lights, at(seconds), sequence)


def accepted_command(state: OutputGuardState, wanted: Command, seconds: float) -> tuple[OutputGuardState, Pulses]:
    state, pulses = GUARD.command(state, wanted, at(seconds))
    assert isinstance(pulses, Pulses), pulses
    return state, pulses


def armed(pulses: tuple[float, ...] = NEUTRAL) -> OutputGuardState:
    """Armed at 8.0 s, last command number 80."""
    state, answer = GUARD.arm(GUARD.start(at(0.0)), Request(at(0.0), 1), at(0.0))
    assert answer == Answer(accepted=True)
    for turn in range(1, 81):
        state, _ = accepted_command(state, command(turn * 0.1, turn, pulses), turn * 0.1)
    assert state.phase is ArmingPhase.ARMED
    return state


def test_starts_disarmed_with_neutral_due_at_once() -> None:
    state = GUARD.start(at(0.0))
    assert GUARD.due(state) <= at(0.0)
    state, pulses = GUARD.tick(state, at(0.0))
    assert pulses == Pulses(NEUTRAL, (1100.0, 1100.0))
    assert pulses.all_us == (*NEUTRAL, 1100.0, 1100.0)
    assert (state.phase, state.reason.code) == (ArmingPhase.DISARMED, OutputReason.NEW)


def test_commands_move_nothing_while_disarmed_but_switch_the_lights() -> None:
    state, pulses = accepted_command(GUARD.start(at(0.0)), command(0.0, 1, FULL, (1900.0, 1500.0)), 0.0)
    assert pulses == Pulses(NEUTRAL, (1900.0, 1500.0))
    state, pulses = accepted_command(state, command(0.1, 2), 0.1)
    assert pulses.lights == (1900.0, 1500.0)


def test_lamps_are_lit_by_themselves_until_nobody_is_received_for_long() -> None:
    state, pulses = GUARD.light(GUARD.start(at(0.0)), (1.0, 0.25), at(0.0))
    assert pulses == Pulses(NEUTRAL, (1900.0, 1300.0))
    _, due = GUARD.tick(state, at(4.9))
    assert due == Pulses(NEUTRAL, (1900.0, 1300.0))
    _, due = GUARD.tick(state, at(5.1))
    assert due == GUARD.neutral
    for turn in range(1, 80):
        state, pulses = accepted_command(state, command(turn * 0.1, turn), turn * 0.1)
    assert pulses.lights == (1900.0, 1300.0)


def test_lamps_leave_running_thrusters_alone() -> None:
    state, before = accepted_command(armed(FULL), command(8.1, 81), 8.1)
    state, pulses = GUARD.light(state, (0.5, 0.0), at(8.12))
    assert pulses == Pulses(before.thrusters, (1500.0, 1100.0), 81)
    _, due = GUARD.tick(state, at(8.6))
    assert due == Pulses(NEUTRAL, (1500.0, 1100.0))


@pytest.mark.parametrize(
    "levels", [(), (1.0,), (1.0,) * 3, *((1.0, wrong) for wrong in (1.01, -0.01, float("nan"), float("inf")))]
)
def test_what_is_no_brightness_is_refused(levels: tuple[float, ...]) -> None:
    state, decision = GUARD.light(GUARD.start(at(0.0)), levels, at(0.0))
    assert isinstance(decision, RefusedCommand)
    assert decision.fault == "not a brightness"
    assert decision.text.startswith(
        f"lamps: found {', '.join(f'{level:g}' for level in levels) or 'none'}, wanted 2 from 0"
    )
    assert state.pulses == GUARD.neutral


def test_arming_is_neutral_for_the_time_of_the_escs() -> None:
    state, _ = GUARD.arm(GUARD.start(at(0.0)), Request(at(-0.5), 1), at(0.0))
    for turn in range(70):
        state, pulses = accepted_command(state, command(turn * 0.1, turn + 1), turn * 0.1)
        assert (state.phase, pulses.thrusters) == (ArmingPhase.ARMING, NEUTRAL)
    state, pulses = accepted_command(state, command(7.0, 71), 7.0)
    assert state.phase is ArmingPhase.ARMED


def test_who_arms_twice_neither_begins_anew_nor_ends_a_flight() -> None:
    state, _ = GUARD.arm(GUARD.start(at(0.0)), Request(at(0.0), 1), at(0.0))
    again, answer = GUARD.arm(state, Request(at(3.0), 2), at(3.0))
    assert (answer.accepted, again.phase, again.since) == (True, ArmingPhase.ARMING, state.since)
    flying = armed(FULL)
    again, answer = GUARD.arm(flying, Request(at(8.05), 2), at(8.05))
    assert (answer.accepted, again.phase, again.armings) == (True, ArmingPhase.ARMED, flying.armings)
    assert GUARD.tick(again, at(8.09))[1] == flying.pulses


def test_it_counts_how_often_it_was_armed_whatever_happened_between() -> None:
    state, pulses = GUARD.start(at(0.0)), NEUTRAL
    for turn in range(3):
        state, _ = GUARD.disarm(state, Request(at(20.0 * turn), 2 * turn), at(20.0 * turn))
        assert state.armings == turn
        state, _ = GUARD.arm(state, Request(at(20.0 * turn + 1.0), 2 * turn + 1), at(20.0 * turn + 1.0))
        for step in range(75):
            now_s = 20.0 * turn + 1.0 + step * 0.1
            state, _ = accepted_command(state, command(now_s, 1000 * turn + step + 1, pulses), now_s)
        assert (state.phase, state.armings) == (ArmingPhase.ARMED, turn + 1)


@pytest.mark.parametrize(
    ("stamp_s", "sequence", "reason"),
    [
        (-1.1, 9, "1.1 s old"),
        (0.2, 9, "ahead of the vehicle's clock"),
        (0.0, 5, "not newer"),
        (0.0, 4, "not newer"),
        (-0.5, 9, "not newer"),
        (-0.6, 9, "not newer"),
    ],
)
def test_arm_request_is_refused_with_its_reason(stamp_s: float, sequence: int, reason: str) -> None:
    state, _ = GUARD.disarm(GUARD.start(at(-0.5)), Request(at(-0.5), 5), at(-0.5))
    after_request, answer = GUARD.arm(state, Request(at(stamp_s), sequence), at(0.0))
    assert not answer.accepted
    assert reason in answer.reason
    assert (answer.reason.reason is Reason.LATE) == (stamp_s < -1.0), "only what came late may be sent again"
    assert after_request.phase is ArmingPhase.DISARMED


def test_an_arm_request_made_before_a_disarm_and_delivered_after_it_is_refused() -> None:
    state, _ = GUARD.disarm(armed(), Request(at(8.0), 3), at(8.0))
    _, answer = GUARD.arm(state, Request(at(7.9), 2), at(8.1))
    assert not answer.accepted


@pytest.mark.parametrize(("operator", "monitor"), [(5, 4_000_000_000), (4_000_000_000, 0), (4_000_000_000, 5), (5, 0)])
def test_a_disarm_by_a_monitor_does_not_outrank_a_later_request_of_the_operator(operator: int, monitor: int) -> None:
    state, _ = GUARD.arm(GUARD.start(at(0.0)), Request(at(0.0), operator), at(0.0))
    state, answer = GUARD.disarm(state, Request(at(0.1), monitor, "no operator for 2 s"), at(0.1))
    assert answer.accepted
    assert (state.phase, state.reason) == (ArmingPhase.DISARMED, "no operator for 2 s")
    _, answer = GUARD.arm(state, Request(at(0.1), operator + 1), at(0.2))
    assert answer.reason == f"request {operator + 1} was made before the vehicle disarmed itself; try again"
    _, answer = GUARD.arm(state, Request(at(0.2), operator), at(0.2))
    assert "not newer" in answer.reason
    state, answer = GUARD.arm(state, Request(at(0.2), operator + 1), at(0.2))
    assert answer == Answer(accepted=True)
    assert state.phase is ArmingPhase.ARMING


def numbered(*numbers: int) -> OutputGuard:
    return replace(GUARD, fresh_number=iter(numbers).__next__)


def from_terminal(
    guard: OutputGuard, state: OutputGuardState, number: int, seconds: float
) -> tuple[OutputGuardState, str]:
    """Ask as somebody does who types: without a stamp. Returns the reason of a refusal."""
    state, answer = guard.arm(state, Request(Stamp(0), number), at(seconds))
    assert answer.accepted is (answer.reason == "")
    assert answer.accepted is (state.phase is ArmingPhase.ARMING)
    return state, answer.reason


def test_who_types_arms_with_the_number_that_the_vehicle_hands_out() -> None:
    guard = numbered(471_100)
    state, why = from_terminal(guard, guard.start(at(0.0)), 0, 1.0)
    assert why == ("request has no stamp; to arm without one, call again within 8 s with sequence: 471100")
    state, why = from_terminal(guard, state, 471_100, 8.9)
    assert why == ""


@pytest.mark.parametrize("late_s", [8.1, 60.0, 1e6])
def test_a_number_that_comes_late_arms_nothing_and_hands_out_another(late_s: float) -> None:
    guard = numbered(471_100, 471_200)
    state, _ = from_terminal(guard, guard.start(at(0.0)), 0, 1.0)
    state, why = from_terminal(guard, state, 471_100, 1.0 + late_s)
    assert why.startswith("the number 471100 is ")
    assert why.endswith("sequence: 471200")
    _, why = from_terminal(guard, state, 471_200, 2.0 + late_s)
    assert why == ""


def test_a_number_counts_once() -> None:
    guard = numbered(471_100, 471_200, 471_300)
    state, _ = from_terminal(guard, guard.start(at(0.0)), 0, 1.0)
    state, why = from_terminal(guard, state, 999_999, 1.1)
    assert why.endswith("sequence: 471200"), "a wrong one ends the number, too: nobody guesses"
    state, why = from_terminal(guard, state, 471_100, 1.2)
    assert why.endswith("sequence: 471300")
    state, why = from_terminal(guard, state, 471_300, 1.3)
    assert why == ""
    state, _ = guard.disarm(state, Request(at(1.4), 0), at(1.4))
    state, answer = numbered(1).arm(state, Request(Stamp(0), 471_300), at(1.5))
    assert not answer.accepted, "the same request, delivered twice"


def test_a_number_that_has_armed_counts_no_more_after_a_fault() -> None:
    guard = numbered(471_100, 471_200)
    state, _ = from_terminal(guard, guard.start(at(0.0)), 0, 1.0)
    state, why = from_terminal(guard, state, 471_100, 1.1)
    assert why == ""
    state = guard.restored(guard.fault(state, STUCK, at(1.2)), at(1.3))
    _, why = from_terminal(guard, state, 471_100, 1.4)
    assert why.endswith("sequence: 471200"), "the same request, delivered twice"


@pytest.mark.parametrize("reason", ["", "no operator for 2 s"])
def test_a_disarm_takes_the_number_back(reason: str) -> None:
    guard = numbered(471_100, 471_200)
    state, _ = from_terminal(guard, guard.start(at(0.0)), 0, 1.0)
    state, _ = guard.disarm(state, Request(at(1.5), 1, reason), at(1.5))
    _, why = from_terminal(guard, state, 471_100, 2.0)
    assert why.endswith("sequence: 471200")


def test_a_clock_that_goes_back_takes_the_number_back() -> None:
    guard = numbered(471_100, 471_200)
    state, _ = from_terminal(guard, guard.start(at(0.0)), 0, 100.0)
    _, why = from_terminal(guard, state, 471_100, 50.0)
    assert why.endswith("sequence: 471200")


def test_requests_with_a_stamp_go_on_after_one_without() -> None:
    guard = numbered(471_100)
    state, _ = guard.disarm(guard.start(at(0.0)), Request(at(0.5), 7), at(0.5))
    state, _ = from_terminal(guard, state, 0, 1.0)
    state, why = from_terminal(guard, state, 471_100, 2.0)
    assert why == ""
    state, _ = guard.disarm(state, Request(at(3.0), 8), at(3.0))
    assert guard.arm(state, Request(at(3.1), 9), at(3.1))[1].accepted


@pytest.mark.parametrize(("before", "later", "accepted"), [(7, 6, False), (7, 7, False), (7, 8, True), (None, 1, True)])
def test_a_request_without_a_stamp_leaves_the_order_of_the_others(
    before: int | None, later: int, accepted: bool
) -> None:
    guard = numbered(471_100)
    state = guard.start(at(0.0))
    if before is not None:
        state, _ = guard.disarm(state, Request(at(0.1), before), at(0.1))
    state, _ = from_terminal(guard, state, 0, 1.0)
    state, _ = from_terminal(guard, state, 471_100, 2.0)
    assert guard.arm(state, Request(at(2.1), later), at(2.1))[1].accepted is accepted


def test_an_older_disarm_leaves_the_order_of_the_requests() -> None:
    state, _ = GUARD.arm(GUARD.start(at(0.0)), Request(at(0.0), 10), at(0.0))
    state, _ = GUARD.disarm(state, Request(at(0.1), 3), at(0.1))
    _, answer = GUARD.arm(state, Request(at(0.2), 5), at(0.2))
    assert answer.reason == "request 5 is not newer than 10, the last one; try again"


def test_numbers_have_six_digits() -> None:
    numbers = [GUARD.fresh_number() for _ in range(1000)]
    assert all(100_000 <= number <= 999_999 for number in numbers)
    assert len(set(numbers)) > 990, "nobody guesses the next one"


def test_a_console_that_starts_again_may_arm_after_a_second() -> None:
    state, _ = GUARD.disarm(armed(), Request(at(8.0), 7), at(8.0))
    _, answer = GUARD.arm(state, Request(at(8.5), 6), at(8.5))
    assert not answer.accepted
    _, answer = GUARD.arm(state, Request(at(9.0), 1), at(9.0))
    assert not answer.accepted
    _, answer = GUARD.arm(state, Request(at(9.1), 1), at(9.1))
    assert answer.accepted


def test_a_disarm_from_the_future_does_not_block_arming() -> None:
    state, _ = GUARD.disarm(armed(), Request(at(9999.0), 7), at(8.0))
    _, answer = GUARD.arm(state, Request(at(8.1), 8), at(8.1))
    assert answer.accepted


def test_disarm_is_obeyed_however_old_it_is() -> None:
    state, answer = GUARD.disarm(armed(), Request(at(-100.0), 0), at(8.0))
    assert answer.accepted
    state, pulses = GUARD.tick(state, at(8.0))
    assert pulses is not None
    assert (state.phase, pulses.thrusters) == (ArmingPhase.DISARMED, NEUTRAL)


def test_arming_times_out_without_commands() -> None:
    state, _ = GUARD.arm(GUARD.start(at(0.0)), Request(at(0.0), 1), at(0.0))
    state, _ = GUARD.tick(state, at(6.9))
    assert state.phase is ArmingPhase.ARMING
    state, pulses = GUARD.tick(state, at(7.0))
    assert (state.phase, pulses) == (ArmingPhase.ARMED, GUARD.neutral)
    state, _ = GUARD.tick(state, at(12.0))
    assert state.phase is ArmingPhase.ARMED
    state, _ = GUARD.tick(state, at(12.1))
    assert (state.phase, state.reason.code) == (ArmingPhase.DISARMED, OutputReason.SILENCE)


def test_an_armed_output_that_refuses_commands_says_so_and_why_it_disarmed() -> None:
    state = armed()
    assert state.unobeyed.code is OutputReason.NONE
    state, _ = GUARD.tick(state, at(8.5))
    assert state.unobeyed.code is OutputReason.NO_COMMAND
    other = RefusedCommand(CommandFault.SENDER, "found 2 publishers, wanted one")
    for tenth in range(85, 126):
        state, _ = GUARD.tick(GUARD.refuse(state, other, at(tenth / 10)), at(tenth / 10))
        assert state.unobeyed == output_reason(OutputReason.UNOBEYED, refused=other.text)
    for tenth in range(126, 132):
        state, _ = GUARD.tick(GUARD.refuse(state, other, at(tenth / 10)), at(tenth / 10))
    assert state.reason == output_reason(OutputReason.DISOBEYED, silent_s=5.0, refused=other.text)
    assert state.unobeyed.code is OutputReason.NONE, "the reason why it is disarmed is enough"


def test_a_refusal_among_obeyed_commands_explains_no_later_silence() -> None:
    state = armed()
    state, refused = GUARD.command(state, command(6.0, 80), at(8.0))
    assert isinstance(refused, RefusedCommand)
    assert state.unobeyed.code is OutputReason.NONE
    state, _ = accepted_command(state, command(8.1, 90), 8.1)
    state, _ = GUARD.tick(state, at(8.7))
    assert state.unobeyed.code is OutputReason.NO_COMMAND
    state, _ = GUARD.command(state, command(6.0, 91), at(8.7))
    assert state.unobeyed.code is OutputReason.UNOBEYED
    assert "old, wanted at most 0.20 s" in state.unobeyed
    state, _ = GUARD.tick(state, at(9.8))
    assert state.unobeyed.code is OutputReason.NO_COMMAND


def test_silence_goes_neutral_before_the_time_promised_and_long_silence_disarms() -> None:
    state = armed()
    for turn in range(1, 6):
        state, pulses = accepted_command(state, command(8.0 + turn * 0.1, 80 + turn), 8.0 + turn * 0.1)
    assert pulses.thrusters == FULL
    assert GUARD.due(state) <= at(8.5 + KNOBS.repeat_s)
    state, held = GUARD.tick(state, at(8.5 + KNOBS.repeat_s))
    assert held is not None
    assert held.thrusters == FULL
    assert GUARD.due(state._replace(written_at=at(8.89))) == at(8.9)
    state, tripped = GUARD.tick(state, at(8.5 + KNOBS.silence_s - KNOBS.margin_s))
    assert tripped is not None
    assert (state.phase, tripped.thrusters, tripped.sequence) == (ArmingPhase.ARMED, NEUTRAL, 0)
    state, _ = GUARD.tick(state, at(13.6))
    assert (state.phase, state.reason.code) == (ArmingPhase.DISARMED, OutputReason.SILENCE)
    state, pulses = accepted_command(state, command(14.0, 200), 14.0)
    assert pulses.thrusters == NEUTRAL


def test_neutral_is_repeated() -> None:
    state, first = GUARD.tick(GUARD.start(at(0.0)), at(0.0))
    assert first is not None
    for turn in range(1, 100):
        state, between = GUARD.tick(state, at(turn * KNOBS.repeat_s - 0.01))
        assert between is None
        state, again = GUARD.tick(state, at(turn * KNOBS.repeat_s))
        assert again == first


@pytest.mark.parametrize(
    ("wanted", "seconds", "reason"),
    [
        (command(7.9, 99), 8.11, "expired"),
        (command(8.3, 99), 8.1, "from the future"),
        (command(8.1, 80), 8.1, "out of order"),
        (command(8.1, 79), 8.1, "out of order"),
        (command(7.95, 99), 8.1, "out of order"),
        (command(8.1, 99, FULL[:7]), 8.1, "wrong count"),
        (command(8.1, 99, (*FULL, 1500.0)), 8.1, "wrong count"),
        (command(8.1, 99, FULL, (1500.0,)), 8.1, "wrong count"),
        (command(8.1, 99, (float("nan"), *FULL[1:])), 8.1, "not a pulse"),
        (command(8.1, 99, (float("inf"), *FULL[1:])), 8.1, "not a pulse"),
        (command(8.1, 99, (0.0, *FULL[1:])), 8.1, "not a pulse"),
        (command(8.1, 99, (499.9, *FULL[1:])), 8.1, "not a pulse"),
        (command(8.1, 99, (2500.1, *FULL[1:])), 8.1, "not a pulse"),
        (command(8.1, 99, FULL, (1500.0, 65535.0)), 8.1, "not a pulse"),
    ],
)
def test_command_is_refused_with_its_reason(wanted: Command, seconds: float, reason: str) -> None:
    _, refusal = GUARD.command(armed(), wanted, at(seconds))
    assert isinstance(refusal, RefusedCommand)
    assert refusal.fault == reason


def test_a_malformed_command_makes_neutral_until_the_next_good_one() -> None:
    state, moving = accepted_command(armed(), command(8.05, 81), 8.05)
    assert moving.thrusters != NEUTRAL
    state, _ = GUARD.command(state, command(8.06, 82, (float("nan"),) * 8), at(8.06))
    assert GUARD.due(state) == at(8.06), "at once"
    state, pulses = GUARD.tick(state, at(8.06))
    assert pulses is not None
    assert pulses.thrusters == NEUTRAL
    _, pulses = accepted_command(state, command(8.1, 83), 8.1)
    assert pulses.thrusters != NEUTRAL


def test_a_sender_that_starts_again_is_received_once_the_old_one_is_silent_but_must_be_armed_anew() -> None:
    state = armed()
    _, refusal = GUARD.command(state, command(8.1, 1), at(8.1))
    assert isinstance(refusal, RefusedCommand)
    state, pulses = accepted_command(state, command(8.45, 1), 8.45)
    assert pulses.thrusters == GUARD.neutral.thrusters
    assert state.phase is ArmingPhase.DISARMED
    assert state.reason.code is OutputReason.OTHER_SENDER
    assert state.commanded_at == at(8.45)


@pytest.mark.parametrize("lost", [1, 1000, 2**31 - 2])
def test_however_many_commands_were_lost_the_next_one_is_newer(lost: int) -> None:
    _, pulses = accepted_command(armed(), command(8.1, 81 + lost), 8.1)
    assert pulses.sequence == 81 + lost


def test_the_sequence_may_wrap() -> None:
    state, _ = accepted_command(armed(), command(8.35, 2**32 - 1), 8.45)
    _, pulses = accepted_command(state, command(8.46, 0), 8.46)
    assert pulses.sequence == 0


def test_pulses_are_clipped_and_slewed() -> None:
    wanted = (2500.0, 500.0, 1600.0, 1500.0, *NEUTRAL[4:])
    state, pulses = accepted_command(armed(), command(8.02, 81, wanted), 8.02)
    assert pulses.thrusters[:4] == (1580.0, 1420.0, 1580.0, 1500.0)
    for turn in range(2, 10):
        state, pulses = accepted_command(state, command(8.0 + turn * 0.02, 80 + turn, wanted), 8.0 + turn * 0.02)
    assert pulses.thrusters[:4] == (1900.0, 1100.0, 1600.0, 1500.0)


def test_after_neutral_pulses_begin_with_the_time_since_then() -> None:
    state, _ = accepted_command(armed(FULL), command(8.1, 81), 8.1)
    state, tripped = GUARD.tick(state, at(8.5))
    assert tripped == GUARD.neutral
    _, pulses = accepted_command(state, command(8.51, 82), 8.51)
    assert pulses.thrusters == pytest.approx((1540.0,) * 8)


def test_a_repetition_is_no_movement() -> None:
    state, repeated = GUARD.tick(armed(), at(8.09))
    assert repeated == replace(GUARD.neutral, sequence=80)
    _, pulses = accepted_command(state, command(8.1, 81), 8.1)
    assert pulses.thrusters == pytest.approx((1860.0,) * 8)


def test_neutral_that_is_repeated_with_lamps_lit_is_no_movement() -> None:
    state, _ = accepted_command(armed(), command(8.1, 81, NEUTRAL, (1900.0, 1500.0)), 8.1)
    state, _ = GUARD.tick(state, at(8.5))
    state, repeated = GUARD.tick(state, at(8.6))
    assert repeated is not None
    assert repeated.lights == (1900.0, 1500.0)
    _, pulses = accepted_command(state, command(8.61, 82), 8.61)
    assert pulses.thrusters == pytest.approx((1860.0,) * 8), "as far as a repetition goes"


def test_neutral_is_due_when_it_is_repeated_though_its_command_grows_old_before() -> None:
    state, _ = accepted_command(armed(), command(8.1, 81, NEUTRAL), 8.1)
    state, _ = GUARD.tick(state, at(8.45))
    assert GUARD.due(state) == at(8.45 + KNOBS.repeat_s)


def test_lamps_of_a_command_go_out_when_none_has_come_for_long() -> None:
    state, _ = accepted_command(GUARD.start(at(0.0)), command(0.1, 1, NEUTRAL, (1900.0, 1900.0)), 0.1)
    state, kept = GUARD.tick(state, at(3.0))
    assert kept is not None
    assert kept.lights == (1900.0, 1900.0)
    assert GUARD.tick(state, at(9.0))[1] == GUARD.neutral


def test_the_first_command_of_all_after_the_arming_time_begins_at_neutral() -> None:
    state, _ = GUARD.arm(GUARD.start(at(0.0)), Request(at(0.0), 1), at(0.0))
    state, pulses = accepted_command(state, command(7.1, 1), 7.1)
    assert (state.phase, pulses.thrusters) == (ArmingPhase.ARMED, NEUTRAL)


STUCK = output_reason(OutputReason.DEVICE, found="bus is stuck")


def test_writes_that_keep_failing_fault_the_output_and_it_comes_back_disarmed() -> None:
    state = GUARD.failed(armed(), STUCK, at(8.0))
    assert state.phase is ArmingPhase.ARMED
    assert GUARD.failed(GUARD.written(state), STUCK, at(8.3)).phase is ArmingPhase.ARMED
    state = GUARD.failed(state, STUCK, at(8.2))
    assert (state.phase, state.reason) == (ArmingPhase.FAULTED, STUCK)
    for made_s in (8.3, 7.0):  # an output that is set up over and over gets to a request late
        _, answer = GUARD.arm(state, Request(at(made_s), 7), at(8.3))
        assert answer == Answer(accepted=False, reason=Refusal(Reason.FAULTED, "output is faulted: bus is stuck"))
    state, pulses = accepted_command(state, command(8.4, 99), 8.4)
    assert pulses.thrusters == NEUTRAL
    state = GUARD.restored(state, at(9.0))
    assert (state.phase, state.reason) == (ArmingPhase.DISARMED, output_reason(OutputReason.RESTORED, fault=STUCK))
    assert GUARD.restored(armed(), at(9.0)) == armed(), "nothing was wrong with it"


def test_a_write_that_fails_once_does_not_put_off_the_end_by_silence() -> None:
    state = GUARD.written(GUARD.failed(armed(), output_reason(OutputReason.DEVICE, found="no acknowledge"), at(10.0)))
    state, _ = GUARD.tick(state, at(12.9))
    assert state.phase is ArmingPhase.ARMED
    state, _ = GUARD.tick(state, at(13.1))
    assert (state.phase, state.reason.code) == (ArmingPhase.DISARMED, OutputReason.SILENCE)


def test_a_write_that_fails_while_arming_starts_the_neutral_time_again() -> None:
    state, _ = GUARD.arm(GUARD.start(at(0.0)), Request(at(0.0), 1), at(0.0))
    state = GUARD.written(GUARD.failed(state, output_reason(OutputReason.DEVICE, found="no acknowledge"), at(5.0)))
    state, _ = accepted_command(state, command(7.5, 1), 7.5)
    assert state.phase is ArmingPhase.ARMING
    state, _ = accepted_command(state, command(12.0, 2), 12.0)
    assert state.phase is ArmingPhase.ARMED


def test_a_clock_that_goes_back_disarms() -> None:
    state, _ = accepted_command(armed(), command(8.05, 81), 8.05)
    still, decision = GUARD.command(state, command(8.06, 82), at(8.03))
    assert isinstance(decision, Pulses)
    assert still.phase is ArmingPhase.ARMED
    state, tick = GUARD.tick(state, at(-3600.0))
    assert tick is not None
    assert (state.phase, tick.thrusters) == (ArmingPhase.DISARMED, NEUTRAL)
    assert state.reason == output_reason(OutputReason.CLOCK, back_s=3608.05)


@pytest.mark.parametrize("bad", [{"margin_s": 0.5}, {"neutral_us": 1000.0}, {"neutral_us": 999.0, "low_us": 500.0}])
def test_contradicting_knobs_are_refused(bad: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        OutputGuardKnobs(**bad)


PULSE = st.one_of(st.floats(1000.0, 2000.0), st.sampled_from([float("nan"), float("inf"), 0.0, 65535.0, 1500.0]))


class HostileHost(RuleBasedStateMachine):
    """A host that keeps to `due` within the margin; everything else about it, and all its callers, is arbitrary.

    The model beside it knows only the wire, the last valid command and the arm requests, not the guard's own mind.
    """

    def __init__(self) -> None:
        super().__init__()
        self.now = at(0.0)
        self.state = GUARD.start(self.now)
        self.sequence = 0
        self.requests = 0
        self.wire: Pulses = GUARD.neutral
        self.moved_at = self.now
        self.valid_at: Stamp | None = None
        self.arm_at: Stamp | None = None
        self.write(GUARD.tick(self.state, self.now))

    def write(self, decided: tuple[OutputGuardState, Pulses | RefusedCommand | None]) -> None:
        self.state, decision = decided
        if not isinstance(decision, Pulses):
            return
        gone_s = max(seconds_between(self.moved_at, self.now), 0.0)
        for old, new in zip(self.wire.thrusters, decision.thrusters, strict=True):
            assert 1100.0 <= new <= 1900.0
            assert new == 1500.0 or abs(new - old) <= KNOBS.slew_usps * min(gone_s, KNOBS.repeat_s) + 1e-6
        if decision.thrusters != self.wire.thrusters:
            self.moved_at = self.now
        self.wire = decision

    @rule(step_s=st.floats(0.0, 6.0), late_s=st.floats(0.0, 0.09))
    def let_time_pass(self, step_s: float, late_s: float) -> None:
        end = after(self.now, step_s)
        while GUARD.due(self.state) < end:
            self.now = max(self.now, after(GUARD.due(self.state), late_s))
            self.is_safe()
            self.write(GUARD.tick(self.state, self.now))
        self.now = max(self.now, end)

    @rule(
        pulses=st.lists(PULSE, min_size=8, max_size=8) | st.lists(PULSE, max_size=9),
        age_s=st.floats(-0.2, 0.4) | st.just(0.0),
        step=st.sampled_from([1, 1, 1, 1, 0, -1, 2**31]),
    )
    def send(self, pulses: list[float], age_s: float, step: int) -> None:
        stamp = after(self.now, -age_s)
        self.sequence = (self.sequence + step) % 2**32
        self.state, decision = GUARD.command(self.state, Command(tuple(pulses), (), stamp, self.sequence), self.now)
        if isinstance(decision, Pulses):
            assert -KNOBS.future_s <= age_s <= KNOBS.command_lifespan_s + 1e-6
            assert len(pulses) == 8
            self.valid_at = stamp
            self.write((self.state, decision))
            self.moved_at = self.now

    @rule(levels=st.lists(st.floats(), max_size=3) | st.just([0.5, 1.0]))
    def light(self, levels: list[float]) -> None:
        before = self.wire.thrusters
        self.write(GUARD.light(self.state, tuple(levels), self.now))
        assert self.wire.thrusters in (before, NEUTRAL)
        assert all(1100.0 <= light <= 1900.0 for light in self.wire.lights)

    @rule(count=st.integers(1, 30), pulse=st.floats(1100.0, 1900.0))
    def stream(self, count: int, pulse: float) -> None:
        for _ in range(count):
            self.let_time_pass(0.02, 0.0)
            self.send([pulse] * 8, 0.0, 1)

    @rule(age_s=st.floats(-0.5, 2.0) | st.just(0.0), step=st.sampled_from([1, 1, 0, -1]))
    def arm(self, age_s: float, step: int) -> None:
        self.requests += step
        phase = self.state.phase
        self.state, answer = GUARD.arm(self.state, Request(after(self.now, -age_s), self.requests), self.now)
        assert answer.accepted == (answer.reason == "")
        if answer.accepted:
            assert age_s <= KNOBS.arm_lifespan_s
            self.arm_at = self.now if phase is ArmingPhase.DISARMED else self.arm_at

    @rule()
    def arm_and_wait(self) -> None:
        self.arm(0.0, 1)
        for _ in range(24):
            self.let_time_pass(0.3, 0.0)
            self.send([1500.0] * 8, 0.0, 1)

    @rule(pulse=st.floats(1100.0, 1900.0))
    def fly(self, pulse: float) -> None:
        self.arm_and_wait()
        self.stream(5, pulse)

    @rule(reason=st.sampled_from(["", "no operator for 2 s"]))
    def disarm(self, reason: str) -> None:
        self.state, _ = GUARD.disarm(self.state, Request(self.now, self.requests, reason), self.now)
        self.arm_at = None
        self.write(GUARD.tick(self.state, self.now))
        assert self.wire.thrusters == NEUTRAL

    @rule(back_s=st.floats(0.0, 100.0))
    def step_clock_back(self, back_s: float) -> None:
        self.now = after(self.now, -back_s)
        self.write(GUARD.tick(self.state, self.now))
        if back_s > KNOBS.margin_s:
            self.valid_at = self.arm_at = None
            assert not self.state.armed
        else:
            self.now = after(self.now, back_s)

    @rule(seconds=st.floats(0.0, 0.5))
    def fail(self, seconds: float) -> None:
        self.state = GUARD.failed(self.state, STUCK, self.now)
        self.let_time_pass(seconds, 0.0)
        self.state = GUARD.failed(self.state, STUCK, self.now)
        self.let_time_pass(0.001, 0.0)

    @precondition(lambda self: self.state.phase is ArmingPhase.FAULTED)
    @rule()
    def restore(self) -> None:
        self.state = GUARD.restored(self.state, self.now)
        assert self.state.phase is ArmingPhase.DISARMED

    @invariant()
    def is_safe(self) -> None:
        if self.wire.thrusters == NEUTRAL:
            return
        assert self.valid_at is not None
        assert seconds_between(self.valid_at, self.now) <= KNOBS.silence_s
        assert self.arm_at is not None
        assert seconds_between(self.arm_at, self.now) >= KNOBS.arming_s


HostileHost.TestCase.settings = settings(max_examples=80, stateful_step_count=40, deadline=None)
TestHostileHost = HostileHost.TestCase


def test_the_guard_of_a_vehicle_has_its_thrusters_and_lamps() -> None:
    made = guard_of(VEHICLE)
    assert (made.rest_us, made.lights, made.knobs) == ((1500.0,) * 8, 2, OutputGuardKnobs())
    slow = OutputGuardKnobs(arming_s=9.0)
    assert guard_of(VEHICLE, slow).knobs == slow


def resting_at(stop_us: float, output: str = "pca9685") -> Vehicle:
    """Our vehicle, of which the last two thrusters have a curve of their own."""
    others = replace(VEHICLE.curves["main"], stop_us=stop_us)
    moved = tuple(replace(one, curve="other") for one in VEHICLE.thrusters[6:])
    return replace(
        VEHICLE,
        curves={**VEHICLE.curves, "other": others},
        thrusters=(*VEHICLE.thrusters[:6], *moved),
        output=replace(VEHICLE.output, device=output),
    )


def test_each_thruster_rests_at_the_stop_pulse_of_its_curve_unless_the_knob_states_otherwise() -> None:
    made = guard_of(resting_at(1520.0))
    assert made.neutral == Pulses((1500.0,) * 6 + (1520.0,) * 2, (1100.0, 1100.0))
    _, pulses = made.tick(made.start(at(0.0)), at(0.0))
    assert pulses == made.neutral
    assert guard_of(resting_at(1520.0), OutputGuardKnobs(neutral_us=1490.0)).neutral.thrusters == (1490.0,) * 8


@pytest.mark.parametrize(
    ("vehicle", "knobs", "words"),
    [
        (resting_at(1950.0), OutputGuardKnobs(), r"T7 rests at 1950 us, wanted 1100 to 1900 us \(low_us, high_us\)"),
        (resting_at(1550.0), OutputGuardKnobs(high_us=1520.0), "T7 rests at 1550 us, wanted 1100 to 1520 us"),
        (resting_at(1526.0, "stm32"), OutputGuardKnobs(), "T7 rests at 1526 us, and the stm32 by itself at 1500 us"),
        (resting_at(1500.0, "stm32"), OutputGuardKnobs(neutral_us=1470.0), "T1 rests at 1470 us, and the stm32"),
    ],
)
def test_a_rest_that_the_output_cannot_make_is_refused(vehicle: Vehicle, knobs: OutputGuardKnobs, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        guard_of(vehicle, knobs)


@pytest.mark.parametrize("end_us", [1100.0, 1900.0])
def test_a_thruster_may_rest_at_either_end_of_what_the_guard_makes(end_us: float) -> None:
    assert guard_of(VEHICLE, OutputGuardKnobs(neutral_us=end_us)).neutral.thrusters == (end_us,) * 8


def test_an_stm32_rests_within_the_dead_band() -> None:
    assert guard_of(resting_at(1525.0, "stm32")).neutral.thrusters[-1] == 1525.0
