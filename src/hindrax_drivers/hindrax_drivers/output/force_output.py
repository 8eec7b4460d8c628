"""The output of a vehicle whose thrusters take newtons from a topic, as those of ros2_control do.

It writes at the far end of the guard, like every output: what is not armed, not fresh or beyond a limit is zero
newtons. Nobody behind the topic promises to stop when messages cease (a forward command controller keeps its last
reference), so the dead man sends zeros too (`nodes/zero_forces.py`).

The pulses of such a vehicle are only how commands travel within the stack. Its curves say what they stand for, at any
supply: a chain that takes newtons has its own.
"""

from collections.abc import Sequence
from typing import Protocol

from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Output
from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import AppliedPulses
from hindrax_core.thrust.curves import running
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.buses.clock import Clock, Meanwhile, nothing
from hindrax_drivers.output.output_guard import Pulses

DEVICE = "ros2_control"
NAME_FIELD = "{name}"


class ForceTopics(Protocol):
    """Where the forces go."""

    def send(self, forces_N: Sequence[float]) -> None:
        """Publish one force per thruster, in the order of the vehicle file."""

    def unheard(self) -> str:
        """Topics without a subscriber; empty when somebody hears every force."""


class ForceOutput:
    """Pulses in, newtons out by the curves of the vehicle file. UsageError where those are not of newtons."""

    def __init__(self, vehicle: Vehicle, topics: ForceTopics, clock: Clock) -> None:
        require_force_curves(vehicle)
        self._topics, self._clock = topics, clock
        self._curves = [
            (running(vehicle.curves[one.curve], vehicle.supply_V), vehicle.curves[one.curve].stop_us, one.reversed)
            for one in vehicle.thrusters
        ]
        self.now = clock.now
        self.wake = clock.wake

    def wait(self, until: Stamp, meanwhile: Meanwhile = nothing) -> None:
        """Sleep until then, or until `wake`; `meanwhile` runs first."""
        self._clock.sleep_until(until, meanwhile=meanwhile)

    def set_up(self) -> str:
        """Send zeros; DeviceError while nobody hears them."""
        self._topics.send([0.0] * len(self._curves))
        self._require_ears()
        return f"{len(self._curves)} thrusters that take newtons"

    def write(self, pulses: Pulses, *, armed: bool) -> None:
        """Send the forces of the pulses; zeros while disarmed, whatever the pulses are."""
        self._topics.send(self._forces_N(pulses.thrusters) if armed else [0.0] * len(self._curves))

    def applied(self, pulses: Pulses) -> Sequence[Stamped[AppliedPulses]]:
        """As wanted, from now on: nobody reports what became of them."""
        return (Stamped(self.now(), AppliedPulses(pulses.thrusters)),)

    def serve(self) -> Sequence[Output]:
        """Return nothing: the topics only go one way."""
        return ()

    def check(self, pulses: Pulses) -> None:
        """Require that somebody still hears every force."""
        del pulses
        self._require_ears()

    def fault(self) -> str:
        """Return no fault: nobody reports one."""
        return ""

    def left_armed(self) -> bool:
        """Return False: nobody is armed at the far end."""
        return False

    def shut_off(self) -> None:
        """Send zeros, which whoever still listens obeys."""
        self._topics.send([0.0] * len(self._curves))

    def close(self) -> None:
        """Close the clock."""
        self._clock.close()

    def _forces_N(self, pulses_us: Sequence[float]) -> list[float]:
        return [
            0.0 if pulse == stop else curve.force_N(2.0 * stop - pulse if turned else pulse)
            for pulse, (curve, stop, turned) in zip(pulses_us, self._curves, strict=True)
        ]

    def _require_ears(self) -> None:
        if unheard := self._topics.unheard():
            raise DeviceError(f"{unheard}: found no subscriber, wanted the controller of the thrusters; start it")


def topics_of(vehicle: Vehicle, port: str) -> list[str]:
    """Topics of the forces.

    Parameters
    ----------
    vehicle
        With its thrusters.
    port
        One topic of an array, or with `{name}` one for each thruster.

    Returns
    -------
    list[str]
        In the order of the thrusters.

    Raises
    ------
    UsageError
        For what is no topic.
    """
    if not port or port.startswith(("/dev/", "mock:")):
        wanted = (
            "a topic such as /thruster_controllers/commands, or one for each thruster: /{name}_controller/reference"
        )
        raise UsageError(f"output.port: found {port!r} with device {DEVICE}, wanted {wanted}")
    if NAME_FIELD not in port:
        return [port]
    return [port.replace(NAME_FIELD, thruster.name) for thruster in vehicle.thrusters]


def require_force_curves(vehicle: Vehicle) -> None:
    """UsageError for a curve that a measured supply would change: forces would be scaled, and never be sent so."""
    for thruster in vehicle.thrusters:
        curve = vehicle.curves[thruster.curve]
        if curve.supply_exponent != 0.0 or (curve.table is not None and len(curve.table.supply_V) > 1):
            raise UsageError(
                f"curves.{thruster.curve}: found thrust that changes with the supply, wanted supply_exponent: 0 and "
                f"at most one voltage, for with output.device {DEVICE} the thrusters of {vehicle.name} take newtons"
            )
