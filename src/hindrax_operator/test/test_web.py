"""The page's server: what is refused and why, what is passed on, what never leaves the folder of runs."""

import contextlib
import http.client
import json
import math
import re
import shutil
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from http.client import HTTPResponse
from pathlib import Path
from types import SimpleNamespace as Message
from typing import Any

import pytest
from web_rig import ADDRESS, ARMED, DISARMED, NAVIGATION, TOKEN, Page, served

from hindrax_analysis.plain import plain
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack_lock import StackLock
from hindrax_control.commissioning.findings import WRONG, Finding, Findings, Mend
from hindrax_control.maneuver.goal import EXCITATIONS, Goal
from hindrax_control.maneuver.maneuver_guards import ManeuverGuardKnobs, ManeuverGuards
from hindrax_control.pool_bounds import PoolBounds
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import Stamp
from hindrax_core.vehicle import AXES, load_vehicle
from hindrax_ident.online.aim import Aim, ExperimentGoal
from hindrax_operator.monitor.graph_link import GraphLink
from hindrax_operator.snapshot import CameraFrame, Snapshot, place_of
from hindrax_operator.web import http_server, page_controller
from hindrax_operator.web import page as page_text
from hindrax_operator.web.access import called_hosts, granted, hosts_of
from hindrax_operator.web.page import PAGE, summary
from hindrax_operator.web.reports import Reports

GETS = ("/events", "/commissioning", "/reports", "/reports/one", "/camera/%2Fcamera", "/nowhere")
POSTS = ("/here", "/fly", "/commission", "/answer", "/cancel", "/stop", "/disarm", "/nowhere")
EVERY = [("GET", path) for path in ("/", *GETS)] + [("POST", path) for path in POSTS]


@pytest.fixture
def page(tmp_path: Path) -> Iterator[Page]:
    with served(tmp_path / "runs") as found:
        yield found


# ---- who may ask


@pytest.mark.parametrize(("method", "path"), EVERY)
@pytest.mark.parametrize(
    "host",
    [None, "evil.example", "127.0.0.1.evil.example", "evil@127.0.0.1", "127.0.0.1/x", "0.0.0.0", "[::1]", "127.1"],
)
def test_another_host_name_is_refused_whatever_is_asked(page: Page, method: str, path: str, host: str | None) -> None:
    status, _, text = page.ask(method, path, b"{}" if method == "POST" else None, {"Host": host})
    assert status == 421
    assert "wanted 127.0.0.1 or localhost" in text
    assert not page.vehicle.orders


@pytest.mark.parametrize(("method", "path"), EVERY)
@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1", "https://127.0.0.1"])
def test_another_page_is_refused_whatever_it_asks(page: Page, method: str, path: str, origin: str) -> None:
    status, _, _ = page.ask(method, path, b"{}" if method == "POST" else None, {"Origin": origin})
    assert status == 403
    assert not page.vehicle.orders


def test_the_page_s_own_origin_is_served_also_through_a_forwarded_port(page: Page) -> None:
    for host in (f"127.0.0.1:{page.server.port}", "localhost:9000", "LOCALHOST"):
        status, _, _ = page.ask("POST", "/stop", b"{}", {"Host": host, "Origin": f"http://{host}"})
        assert status == 202


@pytest.mark.parametrize(("method", "path"), [one for one in EVERY if one != ("GET", "/")])
@pytest.mark.parametrize("given", [None, "", "Bearer ", TOKEN[:-1], f"Bearer {TOKEN}x", "Bearer \xe4", "Basic x"])
def test_without_the_token_nothing_is_served_but_the_empty_page(
    page: Page, method: str, path: str, given: str | None
) -> None:
    status, _, text = page.ask(method, path, b"{}" if method == "POST" else None, {"Authorization": given})
    assert status == 401
    assert "`./hindrax web` printed" in text
    assert not page.vehicle.orders


def test_the_empty_page_shows_nothing_and_runs_only_its_own_script(page: Page) -> None:
    status, headers, text = page.ask("GET", "/", headers={"Authorization": None})
    assert (status, text) == (200, PAGE)
    assert TOKEN not in text
    policy = headers["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "frame-ancestors 'none'" in policy
    assert "unsafe" not in policy.split("script-src")[1].split(";")[0]
    assert headers["Server"].strip() == "hindrax"
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "")


def test_the_page_is_one_answer_with_style_script_and_choices_in_it() -> None:
    markup = Path(page_text.__file__).with_name("page.html").read_text(encoding="utf-8")
    for place in (page_text.NO_CHOICES, page_text.STYLE_LINK, page_text.SCRIPT_LINK):
        assert markup.count(place) == 1
        assert place not in PAGE
    assert f"<script>{page_text.SCRIPT}</script>" in PAGE
    assert "<" not in page_text.CHOICES
    (offered,) = re.findall(r'<script type="application/json" id="choices">(.*)</script>', PAGE)
    assert json.loads(offered) == {"motions": list(AXES), "excitations": ["plateaus", *EXCITATIONS]}


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node on the PATH to parse the script")
def test_the_script_parses() -> None:
    script = Path(page_text.__file__).with_name("page.js")
    assert subprocess.run(["node", "--check", script], check=False).returncode == 0


@pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS", "HEAD", "TRACE", "CONNECT", "PATCH"])
def test_other_methods_are_not_served(page: Page, method: str) -> None:
    status, headers, _ = page.ask(method, "/stop", b"{}")
    assert status == 501
    assert not any(name.lower().startswith("access-control") for name in headers)
    assert not page.vehicle.orders


def test_orders_are_posts_and_strange_paths_lead_nowhere(page: Page) -> None:
    for path in ("/stop", "/fly", "/nowhere", "/?x", "/../runs", "http://127.0.0.1/events"):
        assert page.ask("GET", path)[0] == 404
    assert page.ask("POST", "/reports", b"{}")[0] == 404
    assert not page.vehicle.orders


# ---- orders


@pytest.mark.parametrize("shown", [ARMED, DISARMED, Snapshot()])
def test_an_end_is_always_passed_on(tmp_path: Path, shown: Snapshot) -> None:
    with served(tmp_path, shown) as page:
        assert [page.order(name)[0] for name in ("stop", "cancel", "disarm")] == [202, 202, 202]
        assert page.vehicle.orders == ["stop", "cancel", "disarm"]
        assert page.said == [
            "stop: stopped and disarmed",
            "cancel: no maneuver was running",
            "disarm: the thrusters refused to disarm",
        ]


def test_a_maneuver_needs_an_armed_vehicle_that_is_received_and_one_at_a_time(page: Page) -> None:
    words = {"motions": ["surge", "yaw"], "excitation": "chirp", "seed": 7, "on_cancel": "neutral"}
    page.vehicle.shown = DISARMED
    status, text = page.order("fly", **words)
    assert (status, text) == (
        409,
        "fly: the thrusters are disarmed, wanted armed; `./hindrax arm` in a terminal first\n",
    )
    page.vehicle.shown = replace(ARMED, silent_s=3.0)
    assert page.order("fly", **words)[0] == 409
    page.vehicle.shown = ARMED
    assert page.order("fly", **words)[0] == 202
    assert page.vehicle.orders == [Goal(("surge", "yaw"), "chirp", 7, "neutral")]
    status, text = page.order("fly", **words)
    assert status == 409
    assert "under way" in text
    assert page.vehicle.landed is not None
    page.vehicle.landed("flown: surge, yaw", True)
    assert page.order("fly", **words)[0] == 202


WRONG_T3 = Finding("T3", WRONG, "channel 2", "reversed", mends=(Mend(("thrusters", "T3", "reversed"), True),))


def test_a_commissioning_needs_a_vehicle_at_rest_and_leaves_its_lines(page: Page) -> None:
    status, text = page.order("commission")
    assert (status, "wanted disarmed and afloat" in text) == (409, True)
    page.vehicle.shown = replace(DISARMED, silent_s=3.0)
    assert page.order("commission")[0] == 409
    page.vehicle.shown = DISARMED
    assert page.order("commission", motions=["surge"])[0] == 400
    assert page.order("commission")[0] == 202
    assert page.vehicle.orders == ["commission hindrax"]
    assert page.said == ["commission: keep your hands off"]
    status, text = page.order("commission")
    assert (status, "under way" in text) == (409, True)
    assert page.vehicle.found is not None
    assert page.vehicle.landed is not None
    page.vehicle.found(Findings((WRONG_T3,), wrenches={"T3": (-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)}))
    page.vehicle.landed("flown; not everything is proven", True)
    assert Findings((WRONG_T3,)).sentence == "wrong: T3"
    found = json.loads(page.ask("GET", "/commissioning")[2])
    assert found["rows"] == [["wrong", "T3", "channel 2", "reversed"]]
    assert found["lines"] == ["thrusters.T3.reversed: true"]
    assert found["picture"].startswith("<svg")
    assert page.order("commission")[0] == 202, "and again"


def test_an_experiment_is_asked_of_the_identification_node(page: Page) -> None:
    assert page.order("fly", motions=["surge", "yaw"], until=0.02, minutes=5)[0] == 202
    assert page.vehicle.orders == [ExperimentGoal(("surge", "yaw"), Aim(0.02, 5.0), "hold")]


def test_the_page_cannot_arm(page: Page) -> None:
    assert page.order("arm")[0] == 404
    assert not page.vehicle.orders


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({}, "motions: wanted a list"),
        ({"motions": []}, "no motion"),
        ({"motions": "surge"}, "motions: wanted a list"),
        ({"motions": ["surge", 3]}, "motions: wanted a list"),
        ({"motions": ["loop"]}, "'loop' unknown"),
        ({"motions": ["surge", "surge"]}, "named twice"),
        ({"motions": ["surge"], "excitation": "noise"}, "'noise' unknown"),
        ({"motions": ["surge"], "on_cancel": "sink"}, "'sink' unknown"),
        ({"motions": ["surge"], "seed": -1}, "seed: wanted"),
        ({"motions": ["surge"], "seed": 1 << 32}, "seed: wanted"),
        ({"motions": ["surge"], "seed": True}, "seed: wanted"),
        ({"motions": ["surge"], "seed": 1.5}, "seed: wanted"),
        ({"motions": ["surge"], "force": 5}, "found force"),
        ({"motions": ["surge"], "until": "2%"}, "until: wanted a number"),
        ({"motions": ["surge"], "until": 2.0}, "until 2, wanted"),
        ({"motions": ["surge"], "minutes": -1}, "minutes -1, wanted"),
        ({"motions": ["surge"], "minutes": 10**400}, "minutes: wanted a number"),
        ({"motions": ["surge"], "minutes": float("nan")}, "minutes: wanted a number"),
        ({"motions": ["surge"], "minutes": 5, "seed": 3}, "found seed"),
    ],
)
def test_a_goal_that_makes_no_sense_is_refused_by_the_word(page: Page, words: dict[str, Any], said: str) -> None:
    status, text = page.order("fly", **words)
    assert status == 400
    assert said in text
    assert not page.vehicle.orders


@pytest.mark.parametrize(
    ("body", "headers", "status"),
    [
        (b"", {}, 400),
        (b"{", {}, 400),
        (b"[]", {}, 400),
        (b"[" * 4000, {}, 400),
        (b"\xff", {}, 400),
        (b'{"now": true}', {}, 400),
        (b" " * 5000, {}, 413),
        (b"{}", {"Content-Length": "9" * 400}, 413),
        (b"{}", {"Content-Length": "-2"}, 411),
        (b"{}", {"Content-Length": "\xb2"}, 411),
        (b"{}", {"Content-Length": None}, 411),
        (b"{}", {"Transfer-Encoding": "chunked"}, 411),
        (b"{}", {"Content-Type": "text/plain"}, 415),
        (b"{}", {"Content-Type": None}, 415),
    ],
)
def test_a_body_is_a_short_json_object(page: Page, body: bytes, headers: dict[str, str | None], status: int) -> None:
    assert page.ask("POST", "/stop", body, headers)[0] == status
    assert not page.vehicle.orders


def test_a_page_that_only_watches_orders_nothing_and_is_no_operator(tmp_path: Path) -> None:
    with served(tmp_path, read_only=True) as page:
        for name in ("stop", "cancel", "disarm"):
            assert page.order(name)[0] == 403
        assert page.order("fly", motions=["surge"])[0] == 403
        assert page.order("here")[0] == 204
        assert not page.vehicle.orders
        assert not page.vehicle.present()


def test_who_sees_the_news_is_there_for_a_moment(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    assert not page.vehicle.present()
    assert page.order("here")[0] == 204
    assert page.vehicle.present()
    monkeypatch.setattr(page_controller, "VIEWER_LOST_S", 0.0)
    assert not page.vehicle.present()


# ---- events


@contextlib.contextmanager
def listening(page: Page) -> Iterator[HTTPResponse]:
    connection = http.client.HTTPConnection(ADDRESS, page.server.port, timeout=20)
    connection.request("GET", "/events", headers={"Authorization": f"Bearer {TOKEN}"})
    with contextlib.closing(connection), connection.getresponse() as answer:
        yield answer


def news_has_room(page: Page) -> bool:
    """Whether events are served to one more page within ten seconds."""
    for _ in range(100):
        with listening(page) as answer:
            if answer.status == 200:
                return True
        time.sleep(0.1)
    return False


def test_the_events_carry_the_outcomes_of_orders(page: Page) -> None:
    page.order("disarm")
    with listening(page) as answer:
        assert answer.getheader("Content-Type") == "text/event-stream; charset=utf-8"
        for _ in range(2):
            kind, _, text = answer.readline().partition(b": ")
            assert kind == b"data"
            assert answer.readline() == b"\n"
    found = json.loads(text)
    assert found["thrusters"]["armed"] is True
    assert found["navigation"]["heave"] is None
    vehicle = load_vehicle(default_vehicle())
    assert found["pool"] == {
        "size": [vehicle.pool.length_m, vehicle.pool.width_m],
        "hull": [vehicle.envelope_m[0], vehicle.envelope_m[1]],
    }
    assert found["outcomes"] == [{"number": 1, "sentence": "disarm: the thrusters refused to disarm", "well": False}]


def test_pages_are_bounded_and_make_room_when_they_close(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_server, "STREAMS", 2)
    with served(tmp_path) as page:
        with listening(page) as first, listening(page) as second:
            assert first.readline()
            assert second.readline()
            status, _, text = page.ask("GET", "/events")
            assert status == 503
            assert "2 pages are open" in text
            assert page.order("stop")[0] == 202, "a full house must not keep anybody from stopping"
        assert news_has_room(page)


# ---- cameras


def test_a_frame_of_a_camera_on_the_graph_is_sent_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hindrax_operator.web.http_server.FRAME_TURNS", 2)
    with served(tmp_path, replace(ARMED, cameras=("/front/image",))) as page:
        path = "/camera/%2Ffront%2Fimage"
        assert page.ask("GET", path)[0] == 304, "no frame yet"
        page.vehicle.frames["/front/image"] = CameraFrame(7, b"\xff\xd8\xff and so on".replace(b" ", b""))
        page.vehicle.frames["/back/image"] = page.vehicle.frames["/front/image"]
        connection = http.client.HTTPConnection(ADDRESS, page.server.port, timeout=20)
        connection.request("GET", path, headers={"Authorization": f"Bearer {TOKEN}"})
        with contextlib.closing(connection), connection.getresponse() as answer:
            assert (answer.status, answer.getheader("Content-Type")) == (200, "image/jpeg")
            assert answer.read() == page.vehicle.frames["/front/image"].content
            assert answer.getheader("X-Content-Type-Options") == "nosniff"
            seen = answer.getheader("ETag")
        assert page.ask("GET", path, headers={"If-None-Match": seen})[0] == 304
        for strange in ("/camera/%2Fback%2Fimage", "/camera/", "/camera/..%2F..%2Fetc%2Fpasswd"):
            assert page.ask("GET", strange)[0] == 404
        page.vehicle.frames["/front/image"] = CameraFrame(8, b"<svg onload=alert(1)>")
        status, _, text = page.ask("GET", path)
        assert status == 415
        assert "wanted JPEG, PNG or WebP" in text


# ---- clients that are slow


HEAD = f"POST /stop HTTP/1.1\r\nHost: {ADDRESS}\r\n".encode()
UNFINISHED_BODY = (
    HEAD + f"Authorization: Bearer {TOKEN}\r\nContent-Type: application/json\r\nContent-Length: 4096\r\n\r\n".encode()
)


@contextlib.contextmanager
def dripping(page: Page, count: int, begin: bytes = HEAD) -> Iterator[list[socket.socket]]:
    """Connections that send a byte every 50 ms, and are made anew when the server ends them."""
    over = threading.Event()

    def connect() -> socket.socket:
        made = socket.create_connection((ADDRESS, page.server.port), 20)
        made.sendall(begin)
        return made

    def drip() -> None:
        while not over.wait(0.05):
            for index, one in enumerate(drips):
                try:
                    one.sendall(b" ")
                except OSError:
                    one.close()
                    drips[index] = connect()

    drips = [connect() for _ in range(count)]
    thread = threading.Thread(target=drip)
    thread.start()
    try:
        yield drips
    finally:
        over.set()
        thread.join()
        for one in drips:
            one.close()


def refuses(client: socket.socket) -> bool:
    """Whether the server has ended a connection, seen by sending it another byte."""
    time.sleep(0.05)
    try:
        client.sendall(b" ")
    except OSError:
        return True
    return False


@pytest.mark.parametrize("begin", [b"", HEAD, UNFINISHED_BODY])
def test_stop_gets_through_while_connections_drip(page: Page, begin: bytes) -> None:
    with dripping(page, 40, begin):
        assert [page.order("stop")[0] for _ in range(20)] == [202] * 20
    assert page.vehicle.orders == ["stop"] * 20


def insist_on_stop(page: Page) -> int:
    """Status of a stop, sent again as the page does when its connection had to make room before it was read."""
    for _ in range(20):
        with contextlib.suppress(ConnectionError):
            return page.order("stop")[0]
    return 0


def test_stop_gets_through_when_every_connection_is_taken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_server, "CONNECTIONS", 16)
    with served(tmp_path) as page, listening(page) as answer, dripping(page, 40):
        assert [insist_on_stop(page) for _ in range(20)] == [202] * 20
        for _ in range(20):
            assert answer.readline(), "who reads events does not make room for who drips"


def test_the_connection_that_waits_longest_makes_room_for_a_new_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(http_server, "CONNECTIONS", 2)
    with served(tmp_path) as page, contextlib.ExitStack() as held:
        idle = [held.enter_context(socket.create_connection((ADDRESS, page.server.port), 20)) for _ in range(3)]
        assert idle[0].recv(1) == b"", "the first is closed at once"
        idle[1].sendall(HEAD + b"\r\n")
        assert idle[1].recv(12) == b"HTTP/1.1 401"


@pytest.mark.parametrize("begin", [b"", HEAD, UNFINISHED_BODY])
def test_a_request_has_a_deadline_however_it_drips(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, begin: bytes
) -> None:
    monkeypatch.setattr(http_server, "PATIENCE_S", 0.3)
    with served(tmp_path) as page, socket.create_connection((ADDRESS, page.server.port), 20) as client:
        client.sendall(begin)
        assert any(refuses(client) for _ in range(200)), "dripped for ten seconds, and was still listened to"
    assert not page.vehicle.orders


def test_a_page_that_does_not_take_its_news_makes_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_server, "STREAMS", 1)
    monkeypatch.setattr(http_server, "PATIENCE_S", 0.3)
    with served(tmp_path) as page:
        page.vehicle.title = "x" * 20_000_000  # more than the kernel takes for a client that does not read
        with listening(page) as idle:
            assert idle.status == 200
            assert news_has_room(page)


@pytest.mark.parametrize(("heading_deg", "shown"), [(-0.02, 0.0), (-0.06, 359.9), (359.97, 0.0), (181.26, 181.3)])
def test_a_heading_just_before_north_is_none_of_360_deg(heading_deg: float, shown: float) -> None:
    attitude = (0.0, 0.0, math.radians(heading_deg))
    found: Any = summary(replace(ARMED, navigation=replace(NAVIGATION, attitude_rad=attitude)))
    assert found["navigation"]["heading"] == pytest.approx(shown)


def test_every_number_of_the_news_is_json() -> None:
    found: Any = plain(summary(replace(ARMED, navigation=replace(NAVIGATION, position_m=(math.inf, math.nan)))))
    text = json.dumps(found, allow_nan=False)
    assert json.loads(text)["navigation"]["heading"] == pytest.approx(30.0)
    assert found["holds"][0]["setpoint"] == pytest.approx(270.0)
    silent: Any = plain(summary(Snapshot()))
    assert silent["silent_s"] is None
    (value, _) = found["estimates"][0]["values"]
    assert value == {"name": "k_q", "unit": "N s2/m2", "value": 66.1, "std": 0.4, "band": pytest.approx(1.96 * 0.4)}


def test_the_page_shows_the_plans_of_the_pilot() -> None:
    plans = {"surge": "surge: the pool leaves -0.19 m of room", "yaw": "yaw: 1.20 rad/s, each out and back; 24 s"}
    assert summary(replace(ARMED, plans=plans))["plans"] == plans
    assert summary(Snapshot())["plans"] == {}


def test_the_pool_is_drawn_as_the_pilot_shows_it() -> None:
    """A page that reckoned by itself knew nothing of a `recentre`, of the doubt of the position, of tuned guards."""
    from hindrax_control.nodes.pilot_messages import place_to_msg

    vehicle = load_vehicle(default_vehicle())
    assert summary(Snapshot())["place"] is None
    found = PoolBounds(vehicle, 0.0)
    navigation = replace(NAVIGATION, position_m=(1.0, 0.0), attitude_rad=(0.0, 0.0, math.radians(90.0)))
    found.recentre(navigation, 2.0, 4.0, math.radians(30.0))
    moved = replace(navigation, position_m=(1.0, 1.0), position_sigma_m=0.4)
    place, knobs = found.place(moved), ManeuverGuardKnobs()
    seen = ManeuverGuards(vehicle, knobs).guarded(place, found.walls_m(place), "restarted")
    news: Any = plain(summary(Snapshot(place=place_of(place_to_msg(seen, Stamp(0))))))
    shown = news["place"]
    # 30 deg off the length where the compass says 90: a meter to the east is 0.87 m along and half a meter across.
    assert shown["place"]["x_m"] == pytest.approx(2.0 + math.sqrt(0.75))
    assert shown["place"]["y_m"] == pytest.approx(4.0 + 0.5)
    assert shown["place"]["heading_rad"] == pytest.approx(math.radians(30.0))
    assert shown["place"]["sigma_m"] == pytest.approx(math.hypot(0.1, 0.4))
    assert shown["margin_m"] == pytest.approx(knobs.wall_m + knobs.doubt * math.hypot(0.1, 0.4))
    assert shown["walls_m"].keys() == {"south", "north", "west", "east"}
    assert shown["walls_m"]["west"] < found.walls_m(place)["west"] + 1e-9
    assert shown["unplaced"] == "restarted"


# ---- reports


def test_the_newest_report_comes_with_verdict_and_drag_of_each_motion(tmp_path: Path) -> None:
    surge = "{identifiable: true, drag_force: {speed: [0.1, 0.45], force: [0.7, 14.66], std_calibrated: [0.3, 3.04]}}"
    (tmp_path / "report.html").write_text("<p>", encoding="utf-8")
    file = tmp_path / "coefficients.yaml"
    file.write_text(f"motions:\n  surge: {surge}\n  yaw: {{identifiable: false, drag_force: null}}\n", encoding="utf-8")
    listed = Reports(tmp_path.parent).listed()
    assert [one["motions"] for one in listed if one["name"] == tmp_path.name] == [
        [
            {"motion": "surge", "verdict": "identified", "drag": "14.7 +- 3.0 N at 0.45 m/s"},
            {"motion": "yaw", "verdict": "not identifiable", "drag": ""},
        ]
    ]
    damages = ("motions: {surge: {identifiable: true, drag_force: {speed: []}}}", "motions: 1", "{", "", "\0")
    for damaged in (*damages, "motions: {surge: {}}"):
        file.write_text(damaged, encoding="utf-8")
        assert Reports(tmp_path.parent).listed()[0]["motions"] == []


def test_reports_come_from_the_folder_of_runs_and_nowhere_else(tmp_path: Path) -> None:
    runs, secret = tmp_path / "runs", tmp_path / "secret"
    for folder in (runs / "one", runs / "two é", runs / "empty", runs / "deep" / "three", secret):
        folder.mkdir(parents=True)
    for folder in (runs / "one", runs / "two é", runs / "deep" / "three", secret):
        (folder / "report.html").write_text(f"<p>{folder.name}", encoding="utf-8")
    (runs / "one" / "vehicle.yaml").write_text("secret", encoding="utf-8")
    (runs / "linked").symlink_to(secret)
    (runs / "recorded" / "bag").mkdir(parents=True)
    (runs / "leak").mkdir()
    (runs / "leak" / "report.html").symlink_to(secret / "report.html")
    with served(runs) as page:
        listed = {one["name"]: one["report"] for one in json.loads(page.ask("GET", "/reports")[2])}
        assert listed == {"one": True, "two é": True, "recorded": False}
        assert page.ask("GET", "/reports/one")[2] == "<p>one"
        assert page.ask("GET", "/reports/two%20%C3%A9")[2] == "<p>two é"
        for name in (
            *(
                "",
                ".",
                "..",
                "../secret",
                "..%2Fsecret",
                "%2e%2e/secret",
                "linked",
                "leak",
                "empty",
                "deep/three",
                "recorded",
            ),
            *("one/vehicle.yaml", "one/report.html", "one%00", "/etc/passwd", "%2Fetc%2Fpasswd", "one?x", "%ff"),
        ):
            status, _, text = page.ask("GET", f"/reports/{name}")
            assert (status, "none of that name" in text) == (404, True), name


def test_a_report_that_is_too_large_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "report.html").write_text("<p>long", encoding="utf-8")
    monkeypatch.setattr("hindrax_operator.web.reports.LARGEST_bytes", 3)
    with served(tmp_path) as page:
        assert page.ask("GET", "/reports/one")[0] == 404


def test_without_any_runs_there_are_no_reports(page: Page) -> None:
    assert json.loads(page.ask("GET", "/reports")[2]) == []


# ---- below a prefix, as an extension of BlueOS


@pytest.mark.parametrize("host", ["127.0.0.1", "blueos.local:8480", "evil.example", None])
def test_blueos_learns_from_every_port_what_serves_there(page: Page, host: str | None) -> None:
    status, headers, text = page.ask("GET", "/register_service", headers={"Host": host, "Authorization": None})
    assert (status, headers["Content-Type"]) == (200, "application/json")
    found = json.loads(text)
    # Fields of ServiceMetadata in BlueOS' helper service; those without a default there are needed.
    assert {"name", "description", "icon", "company", "version", "webpage", "api"} <= set(found)
    assert found["works_in_relative_paths"] is True
    assert found["new_page"] is True, "X-Frame-Options forbids the frame that it is shown in otherwise"
    assert TOKEN not in text
    assert page.ask("POST", "/register_service", b"{}", {"Host": "127.0.0.1"})[0] == 404


NAMED = granted("0.0.0.0", ["blueos.local", "blueos-wifi.local"], TOKEN)


@pytest.mark.parametrize("host", ["127.0.0.1:32768", "192.168.1.57", "[fe80::2]:80", "blueos-wifi.local"])
def test_in_a_container_it_is_called_by_any_address_and_by_the_names(tmp_path: Path, host: str) -> None:
    """BlueOS' helper asks 127.0.0.1 for `/`, and for `/register_service` only where that was answered with 200."""
    with served(tmp_path, access=NAMED) as page:
        status, _, text = page.ask("GET", "/", headers={"Host": host, "Authorization": None})
        assert (status, text) == (200, PAGE)
        assert page.ask("POST", "/stop", b"{}", {"Host": host, "Origin": f"http://{host}"})[0] == 202
        assert page.ask("POST", "/stop", b"{}", {"Host": host, "Origin": "http://evil.example"})[0] == 403
        assert page.ask("GET", "/events", headers={"Host": host, "Authorization": None})[0] == 401


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "127.1", "2130706433", "0x7f.1", None])
def test_in_a_container_it_is_called_by_no_other_name(tmp_path: Path, host: str | None) -> None:
    with served(tmp_path, access=NAMED) as page:
        status, _, text = page.ask("GET", "/", headers={"Host": host})
        assert status == 421
        assert "wanted blueos-wifi.local or blueos.local or an address in numbers" in text


def test_every_path_of_the_page_is_relative() -> None:
    called = re.findall(r"\bask\((\S+?)[,)\s]", PAGE.replace("const ask = (path", ""))
    assert {'"events"', '"here"', '"reports"', "name"} <= set(called)
    assert [one for one in called if one.startswith(('"/', "'/", "`/"))] == []
    assert re.findall(r"""(?:href|src|action)=["']/""", PAGE) == []
    assert 'replaceState(null, "", location.pathname)' in PAGE


def test_a_server_of_every_interface_needs_the_names_by_which_it_is_called() -> None:
    assert called_hosts("0.0.0.0", ["BlueOS.local", "192.168.2.2"]) == {"blueos.local", "192.168.2.2"}
    assert called_hosts("192.168.2.2", []) == {"192.168.2.2"}
    with pytest.raises(UsageError, match="every interface"):
        called_hosts("0.0.0.0", [])
    for name in ("", "blueos.local:80", "http://blueos.local", "a b", "*"):
        with pytest.raises(UsageError, match="--host: found"):
            called_hosts("0.0.0.0", [name])


# ---- the command


@pytest.mark.parametrize(
    ("address", "words"),
    [("0.0.0.0", "every interface"), ("::", "every interface"), ("vehicle.local", "in numbers"), ("", "in numbers")],
)
def test_only_one_address_is_served_and_it_is_reported_in_numbers(address: str, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        hosts_of(address)


def test_the_cameras_are_never_gone_between_two_pictures_of_the_vehicle(monkeypatch: pytest.MonkeyPatch) -> None:
    link = GraphLink(None, sim_time=False)
    seen: list[tuple[str, ...]] = []

    def look(*_: object) -> Snapshot:
        seen.append(link.snapshot().cameras)
        return Snapshot()

    monkeypatch.setattr("hindrax_operator.monitor.graph_link.snapshot", look)
    monkeypatch.setattr("hindrax_operator.monitor.graph_link.SNAPSHOT_S", -1.0)
    operator: Any = Message(thrusters=None)
    cameras: Any = Message(names=("/front",), update=lambda: seen.append(link.snapshot().cameras))
    link._cameras = cameras
    for _ in range(3):
        link._refresh(operator)
    assert seen == [(), (), *[("/front",)] * 4]


# ---- the link behind it


class Flown:
    """An operator whose maneuver lasts until it is cancelled; turning is all that happens meanwhile."""

    def __init__(self) -> None:
        self.orders: list[str] = []
        self.beats: list[bool] = []
        self.thrusters = object()

    def beat(self, *, on: bool) -> None:
        self.beats.append(on)

    def cancel(self, found: object) -> str:
        assert found is self
        self.orders.append("cancelled")
        return "done"

    def last(self, link: GraphLink) -> str:
        while "cancelled" not in self.orders:
            link._tick()
        return "flown"


def linked(present: Callable[[], bool] = lambda: True) -> tuple[GraphLink, Flown, Any]:
    """A link that has joined; the operator's node, also as such, is a stand-in."""
    link, operator = GraphLink(None, sim_time=False), Flown()
    link.present = present
    node: Any = operator
    link._operator = node
    return link, operator, node


def test_an_end_is_obeyed_while_a_maneuver_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hindrax_operator.monitor.graph_link.snapshot", lambda *_: Snapshot())
    link, operator, node = linked()
    reported: list[tuple[str, bool]] = []
    link._waiting = True
    link._urgent.put((operator.cancel, lambda *said: reported.append(said)))
    link._carry_out(
        node, lambda found: operator.last(link) if found is node else "", lambda *said: reported.append(said)
    )
    assert reported == [("done", True), ("flown", True)]


def test_a_commissioning_that_waits_to_be_armed_is_cancelled_too(monkeypatch: pytest.MonkeyPatch) -> None:
    link, _, node = linked()

    def waits(
        _operator: object, _vehicle: object, report: Callable[[str], None], *, arm: bool, over: Callable[[], bool]
    ) -> Findings:
        assert not arm, "the page cannot arm"
        report("now arm it")
        assert not over()
        link.end("cancel", lambda *_: None)
        return Findings(ended="stopped by the operator" if over() else "")

    monkeypatch.setattr("hindrax_operator.monitor.graph_link.commission_beside", waits)
    said: list[object] = []
    link.end("stop", lambda *_: None)  # of before
    link.commission(load_vehicle(default_vehicle()), said.append, said.append, lambda *done: said.append(done))
    link._carry_out(node, *link._orders.get())
    assert said == [
        "now arm it",
        Findings(ended="stopped by the operator"),
        ("ended early: stopped by the operator", False),
    ]


def test_a_view_says_which_stack_is_in_its_graph_and_flies_no_real_vehicle_for_a_mock(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    graph, here = {"ROS_DOMAIN_ID": "62"}, list[StackLock]()
    mock = StackLock(5, mock=True, vehicle="v.yaml", folder="runs/a", graph=graph)
    other = StackLock(9, mock=False, vehicle="v.yaml", folder="runs/b", graph={"ROS_DOMAIN_ID": "63"})
    real = replace(other, pid=7, graph=graph)
    monkeypatch.setattr("hindrax_operator.monitor.graph_link.snapshot", lambda *_: Snapshot())
    monkeypatch.setattr("hindrax_operator.monitor.graph_link.stacks", lambda: here)
    monkeypatch.setattr("hindrax_operator.monitor.graph_link.LOOK_S", -1.0)
    monkeypatch.setattr("hindrax_operator.monitor.graph_link._fly", lambda *_: "flown")
    link, said = GraphLink(mock, sim_time=False), list[str]()
    operator: Any = Flown()

    def fly() -> str:
        link._refresh(operator)
        link.fly(Goal(("surge",)), lambda sentence, _: said.append(sentence))
        link._carry_out(operator, *link._orders.get())
        return said[-1]

    here += [replace(mock, pid=6), other]
    assert fly() == "flown"
    assert link.title == "mock vehicle, ROS domain 62, process 6"
    here[:] = [other]
    fly()
    assert link.title == "mock vehicle, ROS domain 62, process 5, ended"
    here[:] = [real]
    assert fly() == (
        "began with mock vehicle, ROS domain 62, process 5, found vehicle, ROS domain 62, process 7: start this view "
        "again for it"
    )


def test_a_link_that_ends_gives_up_waiting_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hindrax_operator.monitor.graph_link.snapshot", lambda *_: Snapshot())
    link, operator, _ = linked()
    link._waiting = True
    link._over.set()
    with pytest.raises(HindraxError, match="no longer waiting for"):
        operator.last(link)
    link._tick()


def test_the_heartbeat_is_that_of_whoever_looks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hindrax_operator.monitor.graph_link.snapshot", lambda *_: Snapshot())
    looks = [True]
    link, operator, _ = linked(lambda: looks[-1])
    for looks[-1] in (True, False, False, True, True):
        link._tick()
    assert operator.beats == [False, True]


def test_a_link_that_may_have_been_forgotten_joins_the_graph_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """So it does when the stack, which stood still as well, is still starting; only the first time must succeed."""
    monkeypatch.setattr("hindrax_operator.monitor.graph_link.AGAIN_S", 0.0)
    monkeypatch.setattr("hindrax_operator.nodes.cameras.Cameras", lambda _node: None)
    link = GraphLink(None, sim_time=False)
    joined: list[Any] = []

    def turn(operator: Any) -> None:
        operator.turns += 1
        if len(joined) == 4:
            link._over.set()
        operator.forgotten = operator.turns == 3
        if operator.forgotten and len(joined) == 1:
            raise HindraxError("it stood still")

    @contextlib.contextmanager
    def join() -> Iterator[Any]:
        operator = Message(node=None, turns=0, forgotten=False, beat=lambda **_: None)
        operator.spin = lambda _seconds: turn(operator)
        joined.append(operator)
        if len(joined) == 3:
            raise HindraxError("waited 5 s for the clock of the mock; is its stack still up?")
        yield operator

    monkeypatch.setattr(link, "_join", join)
    link.run()
    assert link.error is None
    assert [operator.turns for operator in joined] == [3, 3, 0, 1]
