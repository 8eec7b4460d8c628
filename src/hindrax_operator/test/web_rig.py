"""The page served for a vehicle that is only pretended: one picture, orders noted, outcomes told at once."""

import contextlib
import http.client
import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import cast

from hindrax_bringup.share_files import default_vehicle
from hindrax_control.commissioning.findings import Findings
from hindrax_control.hold.holds import HoldState
from hindrax_control.maneuver.goal import Goal
from hindrax_control.pool_bounds import GuardedPlace, PoolPosition
from hindrax_core.signals import NAN, Estimate, Navigation
from hindrax_core.vehicle import AXES, Vehicle, load_vehicle
from hindrax_ident.online.aim import ExperimentGoal
from hindrax_operator.monitor.graph_link import GraphLink
from hindrax_operator.snapshot import CameraFrame, ManeuverView, NodeHealth, Snapshot, Thrusters
from hindrax_operator.web.access import Access, hosts_of
from hindrax_operator.web.http_server import Server
from hindrax_operator.web.page_controller import PageController
from hindrax_operator.web.reports import Reports

TOKEN = "a-token-of-the-tests"
ADDRESS = "127.0.0.1"

NAVIGATION = Navigation(
    attitude_rad=(math.radians(1.2), math.radians(-3.4), math.radians(30.0)),
    rate_radps=(0.0, 0.0, 0.0),
    velocity_mps=(0.312, -0.004, NAN),
    depth_m=0.82,
    altitude_m=0.98,
    position_m=(1.25, -0.33),
    dvl_locked=True,
)
THRUSTERS = Thrusters(
    armed=True,
    state="armed",
    reason="",
    names=tuple(f"T{number}" for number in range(1, 9)),
    pulses_us=(1640, 1640, 1500, 1372, 1560, 1440, 1900, 1500),
    stops_us=(1500,) * 8,
    forces_N=(5.0, 5.0, 0.0, -4.4, 2.0, -2.0, 15.5, 0.0),
    saturated=(False,) * 6 + (True, False),
    disabled=("T3",),
    lost_axes=("sway",),
)
ESTIMATE = Estimate(
    "surge",
    ("k_q", "added_mass"),
    ("N s2/m2", "kg"),
    (66.1, 12.1),
    ((0.16, 0.0), (0.0, 0.25)),
    812,
    812.0,
    learning=True,
    reason="",
)
PLANS = {motion: f"{motion}: 0.45, 0.10 m/s, each out and back; 60 s" for motion in AXES}
PLACE = PoolPosition(4.2, 2.9, math.radians(30.0), NAN, NAN, 0.2)
ARMED = Snapshot(
    time_s=123.0,
    silent_s=0.1,
    navigation=NAVIGATION,
    thrusters=THRUSTERS,
    holds=(
        HoldState("heading", True, math.radians(-90.0), math.radians(0.4)),
        HoldState("altitude", True, 1.0, 0.0, "no echo"),
    ),
    flight=ManeuverView("surge", "done", "", 1.0),
    health={"dvl75": NodeHealth("ok", "measuring", 20.0), "ping1d": NodeHealth("error", "no reading for <b>3.2 s</b>")},
    estimates={"surge": ESTIMATE},
    plans=PLANS,
    place=GuardedPlace(PLACE, {"south": 3.9, "north": 5.4, "west": 2.5, "east": 2.7}, 0.7),
)
DISARMED = replace(ARMED, thrusters=replace(THRUSTERS, armed=False, state="disarmed", reason="at the start"))


OUTCOMES = {
    "stop": ("stopped and disarmed", True),
    "disarm": ("the thrusters refused to disarm", False),
    "cancel": ("no maneuver was running", True),
}


@dataclass
class FakeVehicle:
    """Shows what it is given; a maneuver ends when the test says so."""

    shown: Snapshot = ARMED
    orders: list[object] = field(default_factory=list)
    landed: Callable[[str, bool], None] | None = None
    frames: dict[str, CameraFrame] = field(default_factory=dict)
    title: str = "mock vehicle, ROS domain 3, process 4711"
    present: Callable[[], bool] = lambda: True
    found: Callable[[Findings], None] | None = None

    def snapshot(self) -> Snapshot:
        return self.shown

    def frame(self, camera: str) -> CameraFrame | None:
        return self.frames.get(camera)

    def end(self, how: str, on_done: Callable[[str, bool], None]) -> None:
        self.orders.append(how)
        on_done(*OUTCOMES[how])

    def fly(self, goal: Goal | ExperimentGoal, on_done: Callable[[str, bool], None]) -> None:
        self.orders.append(goal)
        self.landed = on_done

    def commission(
        self,
        vehicle: Vehicle,
        report: Callable[[str], None],
        found: Callable[[Findings], None],
        on_done: Callable[[str, bool], None],
    ) -> None:
        self.orders.append(f"commission {vehicle.name}")
        report("keep your hands off")
        self.found, self.landed = found, on_done


@dataclass
class Page:
    """A running server, and requests to it as a browser would make them."""

    server: Server
    vehicle: FakeVehicle
    said: list[str]

    @property
    def url(self) -> str:
        return f"http://{ADDRESS}:{self.server.port}/"

    def ask(
        self, method: str, path: str, body: bytes | None = None, headers: Mapping[str, str | None] | None = None
    ) -> tuple[int, Mapping[str, str], str]:
        """Status, headers and text; a header of None is left out."""
        wanted = {"Host": f"{ADDRESS}:{self.server.port}", "Authorization": f"Bearer {TOKEN}"}
        wanted |= {} if body is None else {"Content-Type": "application/json", "Content-Length": str(len(body))}
        connection = http.client.HTTPConnection(ADDRESS, self.server.port, timeout=20)
        with contextlib.closing(connection):
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            for name, value in (wanted | dict(headers or {})).items():
                if value is not None:
                    connection.putheader(name, value)
            connection.endheaders(body)
            answer = connection.getresponse()
            return answer.status, dict(answer.getheaders()), answer.read().decode()

    def order(self, name: str, **words: object) -> tuple[int, str]:
        status, _, text = self.ask("POST", f"/{name}", json.dumps(words).encode())
        return status, text


@contextlib.contextmanager
def served(
    runs: Path, shown: Snapshot = ARMED, *, read_only: bool = False, access: Access | None = None
) -> Iterator[Page]:
    """Serve the page of a pretended vehicle at a free port."""
    vehicle = FakeVehicle(shown)
    said: list[str] = []
    of = load_vehicle(default_vehicle())
    controller = PageController(cast("GraphLink", vehicle), of, Reports(runs), read_only=read_only, log=said.append)
    server = Server(ADDRESS, 0, access or Access(hosts_of(ADDRESS), TOKEN), controller)
    server.start()
    try:
        yield Page(server, vehicle, said)
    finally:
        server.close()
