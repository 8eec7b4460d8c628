"""The sensors process: one lifecycle node per sensor of the vehicle file, one thread per wire."""

import sys
import threading
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Generic, TypeVar

from rclpy.node import Node
from std_srvs.srv import Trigger

from hindrax_core.bus_operations import DeviceError, Transaction, pack_transaction
from hindrax_core.driver_interface import Output, RegisterDevice, SerialDevice
from hindrax_core.events import Stamp
from hindrax_core.sensor_table import row_of
from hindrax_core.vehicle import ADDRESS_MEANING, Mount, Vehicle, load_vehicle
from hindrax_drivers.buses.bus_schedule import BusSchedule
from hindrax_drivers.buses.port_threads import BusThread, SerialThread, ServingThread
from hindrax_drivers.buses.ports import open_bus, open_clock
from hindrax_drivers.driver_registry import driver_of
from hindrax_drivers.nodes.device_node import DeviceNode
from hindrax_ros.batched_node import BatchedNode, PublishQueue
from hindrax_ros.parameters import knobs, text, whole
from hindrax_ros.process import spin

RETRY_S = 1.0

ThreadT = TypeVar("ThreadT", bound=ServingThread)


class WireHosts:
    """Every wire of the process and the nodes on it."""

    def __init__(self) -> None:
        self.nodes: list[DeviceNode] = []
        self._publish_queue = PublishQueue()
        self._buses: dict[str, list[tuple[DeviceNode, RegisterDevice]]] = defaultdict(list)

    def add(self, name: str, mount: Mount, vehicle: Vehicle) -> None:
        """Make the node of one sensor; its port and address may be overridden by parameters of that name."""
        node = DeviceNode(name, vehicle, mount.device, publish_queue=self._publish_queue)
        port = text(node, "port", mount.port, "port of the device, or mock:SOCKET [-]")
        clock = text(node, "clock", "system", "clock of a serial port: system, or mock:SOCKET [-]")
        row = driver_of(mount.device)
        if not row.serial:
            mount = replace(mount, address=whole(node, "address", mount.address, ADDRESS_MEANING))
        device: Any = row.make(knobs(node, row.knobs), mount, vehicle)
        self.nodes.append(node)
        if row.serial:
            self._serial(node, port, clock, device, mount.device)
        else:
            self._buses[port].append((node, device))

    def _serial(self, node: DeviceNode, port: str, clock_port: str, device: SerialDevice, kind: str) -> None:
        def serve() -> SerialThread:
            clock = open_clock(clock_port, node.get_name())
            thread = SerialThread(port, device, clock, node.deliver, node.frame)
            node.ready = lambda: thread.ready
            node.now = clock.now
            thread.start()
            return thread

        wire = WireHost(port, [node], serve)
        for service in row_of(kind).services:
            _offer(node, wire, service, getattr(device, service))
        wire.start()

    def open_buses(self) -> None:
        """Start a thread per bus; its nodes share it."""
        for port, listeners in self._buses.items():
            WireHost(port, [node for node, _ in listeners], partial(serve_bus, port, listeners)).start()


class WireHost(Generic[ThreadT]):
    """Serves one wire once it can be opened; retries until then, while its nodes report the reason."""

    def __init__(self, port: str, nodes: Sequence[DeviceNode], serve: Callable[[], ThreadT]) -> None:
        self._port, self._nodes, self._serve = port, nodes, serve
        self._stopping = threading.Event()
        self.thread: ThreadT | None = None
        self._listening = len(nodes)
        for node in nodes:
            node.stop, node.release = self.stop, self.release

    def start(self) -> None:
        """Serve now, or retry in the background."""
        if not self._open():
            threading.Thread(target=self._retry, name=f"open {self._port}", daemon=True).start()

    def stop(self) -> None:
        """Stop the thread of the wire; a second call does nothing."""
        self._stopping.set()
        thread, self.thread = self.thread, None
        if thread is not None:
            thread.stop()

    def release(self) -> None:
        """Release the wire for one of its nodes; the last one stops the thread and frees the port."""
        self._listening -= 1
        if self._listening == 0:
            self.stop()

    def _retry(self) -> None:
        while not self._stopping.wait(RETRY_S) and not self._open():
            pass
        if self._stopping.is_set():  # just as it came up
            self.stop()

    def _open(self) -> bool:
        try:
            self.thread = self._serve()
        except DeviceError as error:
            for node in self._nodes:
                node.troubled(str(error))
            return False
        return True


def serve_bus(port: str, listeners: Sequence[tuple[DeviceNode, RegisterDevice]]) -> BusThread:
    """Open a register bus and start its thread. DeviceError when it is missing."""
    by_name = {node.get_name(): node for node, _ in listeners}

    def tap(name: str, stamp: Stamp, transaction: Transaction, answer: bytes) -> None:
        by_name[name].frame(stamp, sent=True, data=pack_transaction(transaction))
        by_name[name].frame(stamp, sent=False, data=answer)

    bus, schedule = open_bus(port, "sensors"), BusSchedule(tap)
    for node, device in listeners:
        schedule.add(node.get_name(), device, bus.now())
        node.ready = partial(schedule.ready, node.get_name())
        node.now = bus.now
    thread = BusThread(bus, schedule, lambda name, outputs: by_name[name].deliver(outputs))
    thread.start()
    return thread


def _offer(
    node: DeviceNode, wire: WireHost[SerialThread], service: str, request: Callable[[], Iterable[Output]]
) -> None:
    """Serve `NAME/SERVICE`: success says that it was sent; what the device answers is in its topics or diagnostics."""

    def answer(_request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        thread = wire.thread
        if thread is None:
            response.message = "the port is not open yet; /diagnostics says why"
        else:
            thread.call(request)
            response.success = True
        return response

    node.create_service(Trigger, f"{node.get_name()}/{service}", answer)


def make_nodes() -> Sequence[Node]:
    """Read the vehicle file named by the parameter of the first node and make a node per sensor."""
    with_vehicle = BatchedNode("sensors", ros_time=False)
    vehicle = load_vehicle(text(with_vehicle, "vehicle", "", "vehicle file [-]"))
    wires = WireHosts()
    for name, mount in vehicle.sensors.items():
        if name not in vehicle.on_output_line:  # those are read by who owns that line
            wires.add(name, mount, vehicle)
    wires.open_buses()
    return [with_vehicle, *wires.nodes]


def main() -> int:
    """Run the sensors until a signal."""
    return spin(make_nodes)


if __name__ == "__main__":
    sys.exit(main())
