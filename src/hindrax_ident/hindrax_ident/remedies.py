"""What would make an influence known, or a motion identifiable: a sentence for people, and how a program follows it."""

from typing import Self


class Remedy(str):
    """A `str`, so that reports and JSON have the sentence; the last screen of a result reads how it is followed.

    The sentence and its command are one value, in the row of its influence: said in other words, it keeps its command.
    """

    __slots__ = ("command", "condition")
    command: str
    """Of the tool, as one types it in a clone; empty: after the remedy the motion is flown again."""
    condition: str
    """Of a world of the mock: without it the mock has what the remedy is for; empty: a world has no such thing."""

    def __new__(cls, sentence: str, command: str = "", condition: str = "") -> Self:
        """Make a remedy; one of which only the sentence is known is followed by another flight."""
        made = super().__new__(cls, sentence)
        made.command, made.condition = command, condition
        return made

    def __getnewargs__(self) -> tuple[str, str, str]:  # type: ignore[override]  # what makes a copy of it
        return str(self), self.command, self.condition


VEHICLE_FILE, THRUSTER_SWEEP = "./hindrax vehicle new myrov", "./hindrax thruster --help"

WEIGH_THRUST = Remedy(
    "measure the thrust with `./hindrax weigh` or, as for roll and pitch, by a bollard pull", "./hindrax bollard --help"
)
"""The command is that of roll and pitch; the other axes are weighed in the session of a pool day."""
DESCRIBE_THRUSTERS = Remedy(
    "describe the thrusters in the vehicle file, or measure the thrust at several commands", VEHICLE_FILE
)
COAST = Remedy(
    "legs with the thrust off at speed, together with boosts from rest and plateaus, separate it from drag",
    condition="inflow_loss",
)
USE_ITS_SPEEDS = Remedy("fly the speeds at which the coefficients will be used", condition="drag_exponent")
SHORT_TETHER = Remedy("fly near the fixed end of the tether, or with a thinner one", condition="tether_drag")
ONE_AXIS = Remedy("fly one axis at a time, and hold the others")
FLY_TWICE = Remedy("fly it for twice as long, or a second time")
