"""The thrust node: pulses of anybody's output channels in, the wrench that they achieve by the thrust curves out.

By those at the voltage of a battery where one is told, else at the vehicle file's: a T200 has a fifth less thrust at
12.6 V than at 14.8 V.
"""

from dataclasses import replace

from sensor_msgs.msg import BatteryState

from hindrax_control.allocation.allocation_cycle import SupplyVoltage
from hindrax_control.allocation.thrust_curve import PULSE_FIELDS, WRAPS, AppliedWrench, pulses_of_channels
from hindrax_core.events import NS_PER_S, Stamp
from hindrax_core.text.refusals import Reason, refused, unreadable
from hindrax_core.topics import Quality, Topic
from hindrax_core.vehicle import load_vehicle
from hindrax_msgs.msg import ThrusterCommand
from hindrax_ros.batched_node import BatchedNode
from hindrax_ros.diagnostics import DiagnosticsPublisher
from hindrax_ros.graph import optional_class, publisher, subscription
from hindrax_ros.messages.convert import stamp_from_msg, wrench_to_msg
from hindrax_ros.parameters import frame_prefix, text
from hindrax_ros.process import spin

LOOK_S = 0.5
WRAPPED_S = 5.0
"""Age and lead of a stamp that is right but for where it began again [s]."""
PULSES = Topic("pulses", "", Quality(reliable=False, depth=50), 0, "pulse of every output channel [us]")
SUPPLY = Topic(
    "battery", "sensor_msgs/msg/BatteryState", Quality(reliable=False, depth=5), 0, "supply of the thrusters [V]"
)
ACHIEVED = Topic("wrench", "geometry_msgs/msg/WrenchStamped", Quality(), 0, "wrench that the pulses achieve")


class ThrustNode(BatchedNode):
    """Turns `pulses` into `wrench`. Their type is that of the one who publishes them: RCOut, or an array of numbers."""

    def __init__(self) -> None:
        super().__init__("thrust")
        self._vehicle = load_vehicle(text(self, "vehicle", "", "vehicle file [-]"))
        self._applied = AppliedWrench(self._vehicle)
        self._supply = SupplyVoltage(self._vehicle.supply_V)
        self._supply_V: float | None = None
        self._type = ""
        self._out, self._prefix = publisher(self, ACHIEVED), frame_prefix(self)
        self._reporter = DiagnosticsPublisher(self)
        subscription(self, SUPPLY, self._on_battery)
        self.every(LOOK_S, self._look)

    def _look(self) -> None:
        """Subscribe as soon as pulses of a known type are published, and report."""
        for kind in sorted({one.topic_type for one in self.get_publishers_info_by_topic(PULSES.name)}):
            if self._type:
                break
            if kind not in PULSE_FIELDS or optional_class(kind) is None:
                wanted = ", ".join(one for one in PULSE_FIELDS if optional_class(one) is not None)
                why = refused(Reason.MALFORMED, found=kind[:60], wanted=f"one of {wanted}")
                self._reporter.refusals.add(PULSES.name, why)
                continue
            self._type = kind
            self.lead = subscription(self, replace(PULSES, type=kind), self._on_pulses)
        well = f"listening to {self._type}" if self._type else "waiting for pulses"
        now, silent = self.now(), self._supply.silence_warning(self.now())
        self._reporter.report(now, [silent] if silent else (), well, {"supply [V]": self._supply.status_text(now)})

    def _on_battery(self, message: BatteryState) -> None:
        if why := self._supply.update(float(message.voltage), self.now()):
            self._reporter.refusals.add(SUPPLY.name, why)

    def _on_pulses(self, message: ThrusterCommand) -> None:
        stamp = stamp_from_msg(message.header.stamp) if hasattr(message, "header") else Stamp(0)
        try:
            pulses_us = pulses_of_channels(self._vehicle, list(getattr(message, PULSE_FIELDS[self._type])))
        except ValueError as error:
            self._reporter.refusals.add(PULSES.name, unreadable(error))
            return
        supply_V = self._supply.measured_V(self.now())
        if supply_V != self._supply_V:
            self._supply_V, self._applied = supply_V, AppliedWrench(self._vehicle, supply_V)
        wrench = self._applied.wrench(self._applied.forces_N(pulses_us))
        self._out.publish(wrench_to_msg(self._in_time(stamp), wrench, self._prefix))

    def _in_time(self, stamp: Stamp) -> Stamp:
        """Put a stamp right that began again; another that is not of this clock stays, for who reads it to refuse."""
        now, wrap = self.now(), WRAPS.get(self._type, 0)
        if not (stamp and wrap):
            return stamp or now
        whole = Stamp(stamp + wrap * round((now - stamp) / wrap))
        return whole if abs(now - whole) < WRAPPED_S * NS_PER_S else stamp


def main() -> int:
    """Run it until a signal."""
    return spin(lambda: [ThrustNode()])
