"""Lifecycle of a device node, pure: the wanted state, the state the device allows, the transitions between.

The last request of an operator is kept. A device that is lost takes its node back to unconfigured; once it is found
again, the node returns to the state that is wanted, never beyond it.

    unconfigured --configure--> inactive --activate--> active
    unconfigured <--cleanup--   inactive <--deactivate-- active        any of them --shutdown--> finalized, for good
"""

from dataclasses import dataclass
from enum import IntEnum


class State(IntEnum):
    """Primary states, numbered as in lifecycle_msgs/msg/State."""

    UNCONFIGURED = 1
    INACTIVE = 2
    ACTIVE = 3
    FINALIZED = 4


@dataclass(frozen=True, slots=True)
class Transition:
    """Transitions between states, numbered and named as in lifecycle_msgs/msg/Transition."""

    number: int
    label: str
    start: State
    goal: State


CONFIGURE = Transition(1, "configure", State.UNCONFIGURED, State.INACTIVE)
CLEANUP = Transition(2, "cleanup", State.INACTIVE, State.UNCONFIGURED)
ACTIVATE = Transition(3, "activate", State.INACTIVE, State.ACTIVE)
DEACTIVATE = Transition(4, "deactivate", State.ACTIVE, State.INACTIVE)
TRANSITIONS = (
    CONFIGURE,
    CLEANUP,
    ACTIVATE,
    DEACTIVATE,
    Transition(5, "shutdown", State.UNCONFIGURED, State.FINALIZED),
    Transition(6, "shutdown", State.INACTIVE, State.FINALIZED),
    Transition(7, "shutdown", State.ACTIVE, State.FINALIZED),
)
UP = {State.UNCONFIGURED: CONFIGURE, State.INACTIVE: ACTIVATE}
DOWN = {State.ACTIVE: DEACTIVATE, State.INACTIVE: CLEANUP}
ON_REQUEST = {
    State.UNCONFIGURED: "unconfigured on request; `configure` and `activate` bring it back",
    State.INACTIVE: "inactive on request; `activate` brings it back",
    State.FINALIZED: "shut down on request; only a restart of its process brings it back",
    State.ACTIVE: "",
}
"""Reason why a node is not active, by the state that an operator wants."""


def requested(state: State, number: int, label: str) -> Transition | None:
    """Find the transition that a request means. A label outranks the number, as in rcl.

    Parameters
    ----------
    state
        Of the node.
    number, label
        Of the request; an empty label: none.

    Returns
    -------
    Transition | None
        None for what cannot be requested in this state.
    """
    for one in TRANSITIONS:
        if one.start is state and (one.label == label if label else one.number == number):
            return one
    return None


def next_transition(state: State, wanted: State, *, found: bool) -> Transition | None:
    """Find the next automatic transition, as far as the device allows.

    Parameters
    ----------
    state, wanted
        Of the node.
    found
        Whether the device has answered.

    Returns
    -------
    Transition | None
        None when done.
    """
    if State.FINALIZED in (state, wanted):
        return None
    goal = wanted if found else State.UNCONFIGURED
    if state is goal:
        return None
    return UP[state] if state < goal else DOWN[state]
