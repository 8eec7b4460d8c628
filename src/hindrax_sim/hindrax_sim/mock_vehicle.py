"""The mock vehicle for other programs: ptys, the socket of the bus, and time that follows their users."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self, TypeVar

from hindrax_core.bus_operations import Transaction
from hindrax_core.events import Stamp, seconds_between, stamp_from_s, to_s
from hindrax_sim.buses.mock_server import BusServer
from hindrax_sim.buses.mounted_file import MountedFile, Transfer
from hindrax_sim.buses.serial_ends import Pty, TcpEnd, UdpEnd
from hindrax_sim.devices.ardupilot.firmware import ArduSub
from hindrax_sim.hardware import STEP_S, THRUSTERS, Hardware

if TYPE_CHECKING:
    from hindrax_sim.recorded_hardware import RecordedHardware

FileT = TypeVar("FileT", bound=MountedFile)

FREE_LAG_S, DEAD_LAG_S, SLOW = 0.035, 1.0, 8.0
MADE_UP_S = 0.1
PATIENCE_S = 0.1
"""Wall time for which an awake client may hold up one step: a hung client must not stop the mock."""
FROZEN_S = 2.0
"""Wall time that clients may hold up one step after the other; then they no longer do, until they sleep again."""


@dataclass(slots=True)
class Governor:
    """Computes the minimum wall time of a step of the mock, from the pulses written to the emulated outputs (ADR 9).

    While the control loop keeps up, time runs free (or at `rate`, where that is not zero). When it falls behind by more
    than a period and a half, time nearly stands still until it has caught up. A loop that is dead for a second is
    waited for no more than in real time, and so is one while no thruster turns (ADR 44).

    With `waits` off nobody is waited for: the vehicle moves on at `rate`, as a real one does.
    """

    rate: float = 0.0
    turns: bool = True
    """Whether a thruster turns."""
    waits: bool = True
    worst_lag_s: float = 0.0

    def least_wall_s(self, step_s: float, now: Stamp, last_write: Stamp | None) -> float:
        """Minimum wall time of the next step: that of the pace, and more while commands are late, by the rule above.

        Parameters
        ----------
        step_s : [s]
            Length of the step in the mock's time.
        now
            Time of the mock.
        last_write
            When the output was written last; None: never.

        Returns
        -------
        float
            [s].
        """
        lag_s = seconds_between(last_write, now) if last_write is not None else DEAD_LAG_S
        held = self.turns and lag_s < DEAD_LAG_S
        if held:
            self.worst_lag_s = max(self.worst_lag_s, lag_s)
        slowness = 0.0 if lag_s <= FREE_LAG_S or not self.waits else SLOW if held else 1.0
        return max(step_s / self.rate if self.rate > 0.0 else 0.0, step_s * slowness)


class WallTime:
    """Time for programs that sleep by the wall clock, not on the mock's clock.

    It is never behind the mock's, and advances at least as much as wall time between two calls.
    The mock's time goes in steps and may go slowly. A program that orders a conversion of 18 ms and reads it 20 ms
    later by its own clock has waited long enough, whatever the steps between were and whatever a starved mock lost.
    """

    def __init__(self, world: Callable[[], Stamp], wall_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._world, self._wall_ns = world, wall_ns
        self._seen_ns = wall_ns()
        self._at = int(world())

    def now(self) -> Stamp:
        """Time of a transaction that arrives now."""
        wall_ns = self._wall_ns()
        self._at = max(int(self._world()), self._at + wall_ns - self._seen_ns)
        self._seen_ns = wall_ns
        return Stamp(self._at)


class Ports:
    """Hardware behind ports in a folder; `step` advances at most `step_s`. Use it as a context manager."""

    step_s = STEP_S
    """Time that passes in a step, and the wall time that it takes at the wall clock's rate."""

    def __init__(
        self, hardware: "Hardware | RecordedHardware", folder: Path, *, rate: float, waits: bool = True
    ) -> None:
        """`waits`: whether time waits for those who are late; without, `rate` is kept."""
        self.hardware = hardware
        self.governor = Governor(rate, hardware.turns, waits)
        self._socket = folder / "i2c"
        self._ends: dict[str, Pty | UdpEnd | TcpEnd] = {}
        try:
            for name in self.hardware.serial:
                self._ends[name] = Pty(folder / name)
            self._server = BusServer(str(self._socket), self._transfer, self.hardware.stamp)
        except BaseException:
            self._close_ends()
            raise
        self.last_write: Stamp | None = None
        """Time of the mock at the last write of a control loop that uses this clock."""
        self._step_began = time.monotonic()
        self._held_up_s = 0.0
        self.after_step: list[Callable[[Stamp], object]] = []
        """Called with the time after every step."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._server.close()
        self._close_ends()

    def _close_ends(self) -> None:
        for one in self._ends.values():
            one.close()

    @property
    def ports(self) -> dict[str, str]:
        """Port of every device, and of the thruster output, by name."""
        found = {name: str(one.path) for name, one in self._ends.items()}
        return dict.fromkeys((THRUSTERS, *self.hardware.registers), self.clock) | found

    @property
    def clock(self) -> str:
        """Port name of the mock's clock."""
        return f"mock:{self._socket}"

    @property
    def held_up_by(self) -> list[str]:
        """Names of the clients for which time waits."""
        return self._server.busy()

    def step(self) -> None:
        """Advance one step, then serve the clients; wait as the governor requires."""
        now = self._next_stamp()
        sent = self.hardware.advance(now)
        # Set the time before the bytes arrive: readers stamp them with it.
        self._server.serve(now)
        for name, data in sent.items():
            self._exchange(name, data, to_s(now))
        self._wait_for_clients(now)
        self._wait(now)
        self.governor.turns = self.hardware.turns
        for act in self.after_step:
            act(now)

    def serve_clients(self, seconds: float) -> list[str]:
        """Serve clients while time stands still; returns the names of the connected ones."""
        self._server.serve(self.hardware.stamp, seconds)
        return self._server.clients()

    def _next_stamp(self) -> Stamp:
        return Stamp(self.hardware.stamp + stamp_from_s(self.step_s))

    def offer_file(self, make: Callable[[Transfer, Callable[[], Stamp]], FileT]) -> FileT:
        """Offer the bus also as a file for third-party programs.

        Parameters
        ----------
        make
            Gets transfers on the bus and the time of the mock, and makes the file.

        Returns
        -------
        FileT
            The caller closes it, before the mock.
        """
        file = make(self.hardware.i2c.transfer, WallTime(lambda: self.hardware.stamp).now)
        self._server.register(file.fileno(), file.serve)
        return file

    def put_on_network(self, name: str, end: UdpEnd | TcpEnd) -> None:
        """Put a DVL on the network, in place of its pty."""
        self._ends[name].close()
        self._ends[name] = end

    def _exchange(self, name: str, data: bytes, now_s: float) -> None:
        """Write bytes of a device to its port, and pass bytes of the host to the device."""
        port = self._ends[name]
        port.plug(in_place=getattr(self.hardware.serial[name], "connected", True))
        sent = port.read()
        if sent:
            data += self.hardware.serial[name].receive(sent, now_s)
        if sent and name == THRUSTERS and self._server.clients() and self._drives():
            # Without a client of the clock it is a third-party program, which writes at any time.
            self.last_write = self.hardware.stamp
        if data:
            port.write(data)
            self._server.wake(name)

    def _drives(self) -> bool:
        """Whether what was written moves thrusters: an autopilot gets heartbeats too, for which nobody waits."""
        output = getattr(self.hardware, "output", None)
        return output.take_driven() if isinstance(output, ArduSub) else True

    def _wait_for_clients(self, now: Stamp) -> None:
        """Hold time while a client works, for at most `PATIENCE_S`; one that is frozen holds it `FROZEN_S` in all."""
        if not self.governor.waits:
            return
        began_s = now_s = time.monotonic()
        while (busy := self.held_up_by) and now_s < began_s + PATIENCE_S:
            self._server.serve(now, 0.005)
            now_s = time.monotonic()
        self._held_up_s = self._held_up_s + now_s - began_s if busy else 0.0
        if self._held_up_s > FROZEN_S:
            self._server.no_longer_wait()
            self._held_up_s = 0.0

    def _wait(self, now: Stamp) -> None:
        """Serve clients until the minimum wall time of the step is over."""
        while (least := self.governor.least_wall_s(self.step_s, now, self.last_write)) > 0.0:
            left = self._step_began + least - time.monotonic()
            if left <= 0.0:
                break
            self._server.serve(now, min(left, 0.002))
        # At wall-clock rate a late step is made up for: programs that sleep by the wall clock must not drift.
        due = self._step_began + least if 0.0 < least <= self.step_s else time.monotonic()
        self._step_began = max(due, time.monotonic() - MADE_UP_S)

    def _transfer(self, transaction: Transaction, now: Stamp) -> bytes:
        answer: bytes = self.hardware.i2c.transfer(transaction, now)
        if transaction.address == self.hardware.vehicle.output.address:
            self.last_write = now
        return answer


class MockVehicle(Ports):
    """The mock vehicle behind ports."""

    hardware: Hardware
