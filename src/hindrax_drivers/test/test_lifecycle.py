"""Which way a device's node goes by itself, and which transition a request means; every case there is."""

from itertools import product

import pytest

from hindrax_drivers.lifecycle import ON_REQUEST, TRANSITIONS, State, Transition, next_transition, requested

MESSAGES = pytest.importorskip("lifecycle_msgs.msg", reason="needs the ROS environment")


def rest(state: State, wanted: State, *, found: bool) -> State:
    """State in which a node comes to rest by itself."""
    for _ in range(len(State)):
        step = next_transition(state, wanted, found=found)
        if step is None:
            return state
        assert step.start is state
        state = step.goal
    raise AssertionError("it goes in circles")


def test_numbers_are_those_of_the_messages() -> None:
    for state in State:
        assert getattr(MESSAGES.State, f"PRIMARY_STATE_{state.name}") == state
    for one in TRANSITIONS:
        name = f"{one.start.name}_{one.label}" if one.label == "shutdown" else one.label
        assert getattr(MESSAGES.Transition, f"TRANSITION_{name.upper()}") == one.number


@pytest.mark.parametrize(("state", "wanted"), product(list(State)[:3], list(State)[:3]))
def test_a_found_device_is_as_it_is_wanted_and_an_absent_one_is_unconfigured(state: State, wanted: State) -> None:
    assert rest(state, wanted, found=True) is wanted
    assert rest(state, wanted, found=False) is State.UNCONFIGURED


@pytest.mark.parametrize(("state", "found"), product(State, [True, False]))
def test_nothing_shuts_down_or_comes_back_from_it_by_itself(state: State, *, found: bool) -> None:
    assert rest(State.FINALIZED, state, found=found) is State.FINALIZED
    assert rest(state, State.FINALIZED, found=found) is state


@pytest.mark.parametrize(("state", "wanted"), product(State, State))
def test_a_node_never_goes_beyond_what_is_wanted(state: State, wanted: State) -> None:
    step = next_transition(state, wanted, found=True)
    assert step is None or min(state, wanted) <= step.goal <= max(state, wanted)


@pytest.mark.parametrize("state", State)
def test_a_request_means_what_starts_in_this_state_and_nothing_else(state: State) -> None:
    valid = {one.number: one for one in TRANSITIONS if one.start is state}
    for number in range(256):
        assert requested(state, number, "") == valid.get(number)
    for label in ("configure", "cleanup", "activate", "deactivate", "shutdown"):
        found: list[Transition | None] = [one for one in valid.values() if one.label == label]
        assert [requested(state, 255, label)] == (found or [None])
    for label in ("destroy", "transition_success", "transition_error", "Activate", " ", "\0"):
        assert requested(state, 1, label) is None


def test_only_an_active_node_needs_no_reason() -> None:
    assert not ON_REQUEST[State.ACTIVE]
    assert all(ON_REQUEST[state] for state in State if state is not State.ACTIVE)
