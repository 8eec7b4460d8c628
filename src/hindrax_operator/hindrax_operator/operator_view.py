"""What an operator's node knows of the vehicle: the last message of every watched topic. Types only.

Views, progress and reports take an `OperatorView`, so they need neither ROS nor the node: `nodes/operator_node.py` is
one, and a test may be another.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol, TypeVar

from hindrax_control.maneuver.goal import Goal
from hindrax_core.events import Stamp, Stamped
from hindrax_core.signals import Estimate, Navigation
from hindrax_core.text.refusals import Refusal
from hindrax_ident.online.aim import ExperimentGoal

if TYPE_CHECKING:
    from diagnostic_msgs.msg import DiagnosticStatus

    from hindrax_msgs.msg import (
        AllocationStatus,
        HoldStatus,
        ManeuverStatus,
        MotionPlans,
        PoolPlace,
        ThrusterHealth,
        ThrusterState,
    )

T = TypeVar("T")


class OperatorView(Protocol):
    """The vehicle, by its last messages; None where none has come yet."""

    navigation: Stamped[Navigation] | None
    estimates: dict[str, Stamped[Estimate]]
    thrusters: ThrusterState | None
    maneuver: ManeuverStatus | None
    holds: HoldStatus | None
    place: PoolPlace | None
    plans: MotionPlans | None
    health: ThrusterHealth | None
    diagnostics: dict[str, DiagnosticStatus]

    @property
    def allocation(self) -> AllocationStatus | None:
        """The last allocation."""

    @property
    def stoppable(self) -> bool:
        """Whether a thrusters node exists that can be asked to disarm."""

    def now(self) -> Stamp:
        """Time of the stack."""


class OperatorLink(OperatorView, Protocol):
    """A view that can also give orders, each with a time-out that names what it waited for."""

    def wait(self, done: Callable[[], bool], seconds: float, what: Callable[[], str]) -> None:
        """Wait until something is done.

        Parameters
        ----------
        done
            Looked at between the spins.
        seconds : [s]
            Of wall time; HindraxError after it.
        what
            What was waited for, for the sentence of the error.
        """

    def arm(self, *, arm: bool = True, seconds: float = 30.0) -> None:
        """Arm or disarm, and wait until the thrusters report it."""

    def fly(self, goal: Goal | ExperimentGoal, seconds: float) -> tuple[Refusal, str]:
        """Fly to the end; why it was aborted, `NOTHING` when all was flown, and what an experiment has reached."""

    def awaited(self, look: Callable[[], T | None], seconds: float, what: Callable[[], str]) -> T:
        """Wait until something is found.

        Parameters
        ----------
        look
            None until it is found.
        seconds, what
            As of `wait`, with its HindraxError.

        Returns
        -------
        T
            What `look` found.
        """

    def cancel(self) -> None:
        """Cancel what is being flown, if anything."""
