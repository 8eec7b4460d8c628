"""Thruster commands and allocation status as CDR bytes, for the node and for a replay that compares them."""

from __future__ import annotations

from std_msgs.msg import Header

from hindrax_control.allocation.allocation_cycle import PulseCommand
from hindrax_core.events import Stamp
from hindrax_core.rotation import FSD
from hindrax_core.signals import Allocation
from hindrax_core.vehicle import Vehicle
from hindrax_msgs.msg import AllocationStatus
from hindrax_ros.messages.fast_serialization import AllocationWriter, ThrusterStateFields, command_writer


class AllocationMessages:
    """Writes `thrusters/command` and `control/allocation` of one vehicle."""

    def __init__(self, vehicle: Vehicle) -> None:
        self._names = [thruster.name for thruster in vehicle.thrusters]
        self._nominal_V = vehicle.supply_V
        self._status, self._command = AllocationWriter(), command_writer(len(self._names), FSD)

    def command(self, stamp: Stamp, command: PulseCommand) -> bytes:
        """hindrax_msgs/ThrusterCommand, stamped as its wrench."""
        return self._command(stamp, command.sequence, command.pulses_us)

    def status(self, applied: ThrusterStateFields, achieved: Allocation, supply_V: float | None) -> bytes:
        """hindrax_msgs/AllocationStatus, stamped as the applied pulses; `supply_V`: measured, None: the nominal one."""
        return self._status.write(
            applied.stamp,
            (achieved.disabled, achieved.lost_axes, achieved.refused),
            lambda: AllocationStatus(
                header=Header(frame_id=FSD),
                thrusters=self._names,
                forces=achieved.forces_N,
                pulses=applied.pulses_us,
                saturated=achieved.saturated,
                disabled=achieved.disabled,
                lost_axes=achieved.lost_axes,
                refused=achieved.refused,
            ),
            applied.sequence,
            *(*achieved.wanted, *achieved.achieved, *achieved.shortfall),
            *(*achieved.forces_N, *applied.pulses_us, *achieved.saturated),
            self._nominal_V if supply_V is None else supply_V,
            supply_V is not None,
        )
