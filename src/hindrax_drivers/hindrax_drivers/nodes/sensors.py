"""The sensors process: one lifecycle node per sensor of the vehicle file, one thread per wire."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rclpy.node import Node
from std_srvs.srv import Trigger

from hindrax_core.bus import DeviceError, Transaction
from hindrax_core.device import RegisterDevice, SerialDevice
from hindrax_core.events import Stamp
from hindrax_core.vehicle import Mount, Vehicle, load_vehicle
from hindrax_core.wire import pack_transaction
from hindrax_drivers.buses.bus import open_bus
from hindrax_drivers.buses.clock import open_clock
from hindrax_drivers.buses.schedule import BusOutput, BusSchedule
from hindrax_drivers.buses.serial_thread import SerialThread
from hindrax_drivers.buses.thread import BusThread
from hindrax_drivers.nodes.device_node import DeviceNode
from hindrax_drivers.registry import DEVICES
from hindrax_ros.frames import RECEIVED, SENT
from hindrax_ros.outbox import Outbox
from hindrax_ros.parameters import knobs, text
from hindrax_ros.polled import PolledNode
from hindrax_ros.process import spin

RETRY_BUS_S = 1.0


class Wires:
    """Every wire of the process, and the nodes that listen to them."""

    def __init__(self) -> None:
        self.nodes: list[DeviceNode] = []
        self._outbox = Outbox()
        self._buses: dict[str, list[tuple[DeviceNode, RegisterDevice]]] = defaultdict(list)

    def add(self, name: str, mount: Mount, vehicle: Vehicle) -> None:
        """Make the node of one sensor; its port may be overridden by the parameter `port`."""
        node = DeviceNode(name, vehicle, outbox=self._outbox)
        port = text(node, "port", mount.port, "port of the device, or mock:SOCKET [-]")
        clock = text(node, "clock", "system", "clock of a serial port: system, or mock:SOCKET [-]")
        row = DEVICES[mount.device]
        device: Any = row.make(knobs(node, row.knobs), mount, vehicle)
        self.nodes.append(node)
        if row.serial:
            self._serial(node, port, clock, device)
        else:
            self._buses[port].append((node, device))

    def _serial(self, node: DeviceNode, port: str, clock_port: str, device: SerialDevice) -> None:
        clock = open_clock(clock_port, node.get_name())
        thread = SerialThread(
            port,
            device,
            clock,
            node.deliver,
            lambda stamp, sent, data: node.tap.add(stamp, SENT if sent else RECEIVED, data),
        )
        node.ready = lambda: thread.ready
        node.now, node.stop = clock.now, thread.stop
        if hasattr(device, "request_profile"):
            _offer_profile(node, partial(thread.ask, device.request_profile))
        thread.start()

    def open_buses(self) -> None:
        """Start a thread per bus; a bus that cannot be opened is tried again, and its nodes say why."""
        for port, listeners in self._buses.items():
            BusHost(port, listeners).start()


def _offer_profile(node: DeviceNode, ask: Callable[[], None]) -> None:
    """Serve `DEVICE/request_profile`: the next echo comes with its profile."""

    def answer(_request: Any, response: Any) -> Any:
        ask()
        response.success = True
        return response

    node.create_service(Trigger, f"{node.get_name()}/request_profile", answer)


class BusHost:
    """Opens one register bus, again and again until it is there, and joins its nodes to its thread."""

    def __init__(self, port: str, listeners: Sequence[tuple[DeviceNode, RegisterDevice]]) -> None:
        self._port, self._listeners = port, listeners
        self._by_name = {node.get_name(): node for node, _ in listeners}
        self._stopping = threading.Event()
        self._thread: BusThread | None = None
        for node, _ in listeners:
            node.stop = self.stop

    def start(self) -> None:
        """Open now, or keep trying in the background."""
        if not self._open():
            threading.Thread(target=self._retry, name=f"open {self._port}", daemon=True).start()

    def stop(self) -> None:
        """End the thread of the bus; the second of two nodes finds it ended."""
        self._stopping.set()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.stop()

    def _retry(self) -> None:
        while not self._stopping.wait(RETRY_BUS_S) and not self._open():
            pass

    def _open(self) -> bool:
        try:
            bus = open_bus(self._port, "sensors")
        except DeviceError as error:
            for node, _ in self._listeners:
                node.troubled(str(error))
            return False
        schedule = BusSchedule(self._tap)
        for node, device in self._listeners:
            schedule.add(node.get_name(), device, bus.now())
            node.ready = partial(schedule.ready, node.get_name())
            node.now = bus.now
        self._thread = BusThread(bus, schedule, self._deliver)
        self._thread.start()
        return True

    def _tap(self, name: str, stamp: Stamp, transaction: Transaction, answer: bytes) -> None:
        tap = self._by_name[name].tap
        tap.add(stamp, SENT, pack_transaction(transaction))
        tap.add(stamp, RECEIVED, answer)

    def _deliver(self, name: str, outputs: Sequence[BusOutput]) -> None:
        self._by_name[name].deliver(outputs)


def make_nodes() -> Sequence[Node]:
    """Read the vehicle file named by the parameter of the first node and make a node per sensor."""
    with_vehicle = PolledNode("sensors", ros_time=False)
    vehicle = load_vehicle(text(with_vehicle, "vehicle", "", "vehicle file [-]"))
    wires = Wires()
    for name, mount in vehicle.sensors.items():
        wires.add(name, mount, vehicle)
    wires.open_buses()
    return [with_vehicle, *wires.nodes]


def main() -> int:
    """Run the sensors until a signal."""
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    os.environ.setdefault("PYTHONUNBUFFERED", "1")
    return spin(make_nodes)


if __name__ == "__main__":
    sys.exit(main())
