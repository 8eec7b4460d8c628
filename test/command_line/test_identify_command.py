"""`identify` over third-party records: CSV, MCAP, sqlite3, any topics and frames; no confidence without cause."""

import functools
import itertools
import json
import math
import re
import shutil
import sqlite3
import struct
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_ros2.writer import Writer

from hindrax_analysis.coefficients_file import read_coefficients
from hindrax_analysis.records.third_party_bag import TopicSelection, read_bag, topics_of
from hindrax_analysis.testing.ulog import ulog
from hindrax_bag.read import bag_reader, compression
from hindrax_bag.read.bag_reader import messages
from hindrax_bag.read.recovery import recover
from hindrax_bringup.clone import clone_root
from hindrax_bringup.share_files import default_vehicle
from hindrax_cli.command_line import main
from hindrax_cli.commands.data import identify
from hindrax_control.allocation.thrust_curve import AppliedWrench, thrust_curves
from hindrax_core.errors import UsageError
from hindrax_core.topics import MANEUVER, resolved
from hindrax_core.vehicle import Drag, Vehicle, load_vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.model.motion_model import Model
from hindrax_ident.testing.synthetic_runs import Flight, back_and_forth, fly
from hindrax_tools import ardusub

MASS_kg = 20.0
TRUTH = {"k_q": 66.48, "k_l": 1.25, "added_mass": 12.0}
FIELDS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "geometry_msgs/PoseWithCovariance": "Pose pose\nfloat64[36] covariance",
    "geometry_msgs/Pose": "Point position\nQuaternion orientation",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/TwistWithCovariance": "Twist twist\nfloat64[36] covariance",
    "geometry_msgs/Twist": "Vector3 linear\nVector3 angular",
    "geometry_msgs/Wrench": "Vector3 force\nVector3 torque",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
}
PARTS = "".join(f"{'=' * 80}\nMSG: {part}\n{fields}\n" for part, fields in FIELDS.items())
STAMPED = "std_msgs/Header header\n"
DEFINITIONS = {
    "geometry_msgs/msg/WrenchStamped": f"{STAMPED}Wrench wrench\n{PARTS}",
    "geometry_msgs/msg/Wrench": f"Vector3 force\nVector3 torque\n{PARTS}",
    "geometry_msgs/msg/TwistStamped": f"{STAMPED}Twist twist\n{PARTS}",
    "geometry_msgs/msg/TwistWithCovarianceStamped": f"{STAMPED}TwistWithCovariance twist\n{PARTS}",
    "geometry_msgs/msg/PoseStamped": f"{STAMPED}geometry_msgs/Pose pose\n{PARTS}",
    "nav_msgs/msg/Odometry": f"{STAMPED}string child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
    f"geometry_msgs/TwistWithCovariance twist\n{PARTS}",
    "sensor_msgs/msg/Imu": f"{STAMPED}geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
    "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
    f"geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n{PARTS}",
    "marine_acoustic_msgs/msg/Dvl": f"{STAMPED}uint8 velocity_mode\ngeometry_msgs/Vector3 velocity\n"
    f"float64[9] velocity_covar\n{PARTS}",
    "sensor_msgs/msg/FluidPressure": f"{STAMPED}float64 fluid_pressure\nfloat64 variance\n{PARTS}",
    "dvl_msgs/msg/DVL": f"{STAMPED}geometry_msgs/Vector3 velocity\nfloat64 fom\nfloat64 altitude\n"
    f"bool velocity_valid\n{PARTS}",
    "mavros_msgs/msg/RCOut": f"{STAMPED}uint16[] channels\n{PARTS}",
    "my_msgs/msg/Escs": f"{STAMPED}Set set\nstring mode\n{PARTS}{'=' * 80}\nMSG: my_msgs/Set\nfloat32[] throttle\n",
}
START_S = 1_700_000_000.0


@functools.cache
def flight(
    levels: tuple[float, ...] | tuple[float, float, float, float], end_s: float, span_s: float, k_q: float
) -> Flight:
    theta = np.array([k_q, TRUTH["k_l"], 0.0, MASS_kg + TRUTH["added_mass"]])
    return fly(Model(0, MASS_kg), theta, back_and_forth(levels, span_s, end_s), 0.0)


def flown(
    *,
    levels: tuple[float, ...] = (3.0, 6.0, 10.0, 14.0),
    noise: float = 0.01,
    gain: float = 1.0,
    current: float = 0.0,
    seed: int = 0,
    end_s: float = 80.0,
    span_s: float = 5.0,
    k_q: float = 66.48,
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Times and velocities at 10 Hz, times and forces at 25 Hz, of a vehicle that the model describes."""
    true = flight(levels, end_s, span_s, k_q)
    rng = np.random.default_rng(seed)
    t, v = true.grid.times_s[::20], true.path.v[::20]
    return (t, v + current + noise * rng.standard_normal(len(v))), (true.times_s[::2], gain * true.commands[::2])


def as_csv(
    path: Path, velocities: tuple[Array, Array], forces: tuple[Array, Array], names: tuple[str, str] = ("u", "X")
) -> Path:
    rows = [(t, f"{v:.6f}", "") for t, v in zip(*velocities, strict=True)]
    rows += [(t, "", f"{f:.6f}") for t, f in zip(*forces, strict=True)]
    lines = [f"{t:.4f},{a},{b}" for t, a, b in sorted(rows, key=lambda row: row[0])]
    path.write_text("\n".join([f"t,{names[0]},{names[1]}", *lines]))
    return path


class Desk:
    """Where records are identified: a folder for them, and the smallest vehicle file there is."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self.capsys = folder, capsys
        self.small = folder / "small.yaml"
        self.small.write_text(f"name: small\nmass_kg: {MASS_kg}\nvolume_m3: 0.0203\nenvelope_m: [0.6, 0.5, 0.4]\n")

    def csv(self, **record: Any) -> Path:
        return as_csv(self.folder / "a.csv", *flown(**record))

    def identified(self, *words: object) -> Any:
        assert main(["identify", *map(str, words), "--json"]) == 0
        return json.loads(self.capsys.readouterr().out)

    def of_small(self, *words: object) -> Any:
        return self.identified(*words, "--vehicle", self.small)

    def surge(self, *words: object) -> Any:
        return self.of_small(*words)["motions"]["surge"]

    def refused(self, *words: object, code: int = 2) -> str:
        assert main(["identify", *map(str, words)]) == code
        printed = self.capsys.readouterr().err.strip()
        assert printed.startswith("hindrax identify: ")
        assert "\n" not in printed
        return printed


@pytest.fixture
def desk(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Desk:
    return Desk(tmp_path, capsys)


def is_true(surge: dict[str, Any], sigmas: float = 4.0) -> bool:
    return all(abs(surge[name]["value"] - TRUTH[name]) < sigmas * surge[name]["std"] for name in TRUTH)


def force_at(surge: dict[str, Any], speed: float) -> float:
    found: float = surge["k_q"]["value"] * speed**2 + surge["k_l"]["value"] * speed
    return found


# ---- CSV


def test_csv_gives_the_truth_with_the_smallest_vehicle_file(desk: Desk) -> None:
    document = desk.of_small(desk.csv())
    surge = document["motions"]["surge"]
    assert surge["identifiable"]
    assert is_true(surge)
    assert (document["aborted"], document["aborted_by"]) == (None, None)
    assert document["report"] is None
    assert set(document["motions"]) == {"surge"}


def test_a_report_and_a_file_are_left_where_asked(desk: Desk) -> None:
    page, file = desk.folder / "a.html", desk.folder / "a.yaml"
    words = [desk.csv(), "--vehicle", desk.small, "--report", page, "--coefficients", file]
    document = desk.identified(*words)
    assert document["report"] == str(page)
    assert "Online estimate of k_q" in page.read_text()
    assert "small" in file.read_text()


def test_the_table_states_what_is_known_and_what_is_not(desk: Desk) -> None:
    record = desk.csv(levels=(0.3, 0.5), noise=0.003)
    assert main(["identify", str(record), "--vehicle", str(desk.small)]) == 0
    printed = desk.capsys.readouterr().out
    assert "* surge: not identifiable" in printed
    assert re.search(r"surge\* .* 0\.\d+ N at 0\.\d+ m/s .* 0\.\d+ to 0\.\d+ ", printed)
    assert "estimated delays" not in printed
    assert "COB-2023" not in printed


def test_the_delays_of_an_identified_motion_are_said(desk: Desk) -> None:
    assert main(["identify", str(desk.csv()), "--vehicle", str(desk.small)]) == 0
    printed = desk.capsys.readouterr().out
    assert re.search(r"surge: estimated delays: thrust 0\.\d\d s; velocity stamps 0\.\d\d s too (late|early)", printed)


def test_a_part_of_a_record_is_taken(desk: Desk) -> None:
    whole, part = desk.surge(desk.csv()), desk.surge(desk.csv(), "--from", 15, "--to", 65)
    assert part["samples"] < 0.8 * whole["samples"]
    assert is_true(part)


def test_a_dvl_without_lock_is_reported_and_leaves_the_truth(desk: Desk) -> None:
    (t, v), forces = flown()
    for begin_s in (7.0, 22.0, 50.0):
        v = np.where((t > begin_s) & (t < begin_s + 4.0), 0.0, v)
    found = desk.of_small(as_csv(desk.folder / "lost.csv", (t, v), forces))
    assert any("exactly 0 in motion" in one for one in found["assumptions"])
    assert found["motions"]["surge"]["identifiable"]
    assert is_true(found["motions"]["surge"])


def test_one_file_per_topic_is_one_record(desk: Desk) -> None:
    velocities, forces = flown()
    files = []
    for name, header, (t, values) in (
        ("odometry", "field.twist.twist.linear.x", velocities),
        ("thrust", "field.wrench.force.x", forces),
    ):
        files.append(desk.folder / f"{name}.csv")
        rows = [f"{round(1e9 * (START_S + at))},{value:.6f}" for at, value in zip(t, values, strict=True)]
        files[-1].write_text("\n".join([f"%time,{header}", *rows]))
    apart = desk.of_small(*files)
    together = desk.of_small(as_csv(desk.folder / "one.csv", velocities, forces))
    k_q, alone = (one["motions"]["surge"]["k_q"]["value"] for one in (together, apart))
    assert alone == pytest.approx(k_q, 1e-3)
    assert "runs" not in apart
    assert "holds velocities alone" in desk.refused(files[0], files[0], "--vehicle", desk.small)
    assert desk.refused(files[0], "--vehicle", desk.small, code=1)


def test_coefficients_predict_a_record_that_they_were_not_fitted_to(desk: Desk) -> None:
    fitted, fresh = desk.csv(), as_csv(desk.folder / "fresh.csv", *flown(seed=3, noise=0.02))
    file, plot = desk.folder / "coefficients.yaml", desk.folder / "fresh.svg"
    desk.of_small(fitted, "--coefficients", file)
    assert main(["predict", str(file), str(fresh), "--vehicle", str(desk.small), "--plot", str(plot), "--json"]) == 0
    printed = desk.capsys.readouterr()
    assert "another vehicle" not in printed.err
    surge = json.loads(printed.out)["motions"]["surge"]
    assert surge["rmse"] == pytest.approx(0.02, rel=0.3)
    assert surge["rmse_stays_still"] > 0.2
    assert plot.read_text().startswith("<?xml")
    file.write_text(file.read_text().replace("vehicle: small", "vehicle: large"))
    assert main(["predict", str(file), str(fresh), "--vehicle", str(desk.small)]) == 0
    assert "coefficients of large, record of small" in desk.capsys.readouterr().err
    assert main(["predict", str(file), str(fresh)]) == 2
    assert "name one with --vehicle" in desk.capsys.readouterr().err
    assert main(["predict", str(file), str(fresh), "--vehicle", str(desk.small), "--dof", "yaw"]) == 1
    desk.capsys.readouterr()
    assert main(["predict", str(file), str(fresh), "--vehicle", str(desk.small), "--from", "5", "--to", "2"]) == 2
    assert "--to 2: wanted more than --from 5" in desk.capsys.readouterr().err


def test_another_axis_has_its_units(desk: Desk) -> None:
    yaw = desk.of_small(as_csv(desk.folder / "a.csv", *flown(), names=("r", "N")))["motions"]["yaw"]
    assert yaw["k_q"]["unit"] == "N m s^2"


# ---- never sure without cause


@pytest.mark.parametrize(("excess_N", "reported"), [(3.0, True), (0.0, False)])
def test_a_mass_that_cannot_be_is_reported(desk: Desk, excess_N: float, reported: bool) -> None:
    velocities, (t, force) = flown()
    floats_N = load_vehicle(desk.small).net_buoyancy_N + excess_N
    heave = desk.of_small(as_csv(desk.folder / "heave.csv", velocities, (t, force + floats_N), ("w", "Z")))["motions"][
        "heave_down"
    ]
    assert any("check mass_kg, volume_m3" in one for one in heave["warnings"]) == reported


@pytest.mark.parametrize(
    "record",
    [
        {"levels": (0.05, 0.1), "noise": 0.03},
        {"levels": (0.15,), "noise": 0.02},
        {"levels": (3.0,), "end_s": 6.0},
        {"gain": 0.0},
        {"levels": (8.0,), "span_s": 1000.0},
    ],
    ids=["drowned in noise", "one slow speed", "too short", "no thrust", "thrust never changes"],
)
def test_what_cannot_be_known_is_called_so(desk: Desk, record: dict[str, Any]) -> None:
    surge = desk.surge(desk.csv(**record))
    assert not surge["identifiable"]
    assert surge["reasons"]


def test_the_wrong_sign_is_named(desk: Desk) -> None:
    surge = desk.surge(desk.csv(gain=-1.0, end_s=25.0))
    assert not surge["identifiable"]
    assert "against_thrust" in surge["reason_codes"]


def test_a_current_is_seen_or_its_harm_lies_within_the_band(desk: Desk) -> None:
    """A slow one, as it is not seen; hindrax_ident's test_honesty.py has others."""
    surge = desk.surge(desk.csv(current=0.03))
    assert not surge["identifiable"] or is_true(surge)


def test_motion_that_has_nothing_to_do_with_the_thrust(desk: Desk) -> None:
    (t, _), forces = flown(end_s=40.0)
    wander = np.cumsum(np.random.default_rng(3).standard_normal(len(t))) * 0.02
    surge = desk.surge(as_csv(desk.folder / "a.csv", (t, wander), forces))
    assert not surge["identifiable"]


def test_a_slow_record_still_shows_the_drag_over_its_speeds(desk: Desk) -> None:
    surge = desk.surge(desk.csv(levels=(0.3, 0.5), noise=0.003))
    band = surge["drag_force"]
    truth = [TRUTH["k_q"] * u * u + TRUTH["k_l"] * u for u in band["speed"]]
    pairs = zip(band["force"], band["std"], truth, strict=True)
    assert all(abs(force - true) < 4.0 * std for force, std, true in pairs)


def test_pauses_part_the_record(desk: Desk) -> None:
    (t, v), forces = flown()
    keep = (t < 30.0) | (t > 40.0)
    surge = desk.surge(as_csv(desk.folder / "a.csv", (t[keep], v[keep]), forces))
    assert surge["identifiable"]
    assert is_true(surge)


@pytest.mark.parametrize(("speed", "force"), [(1000.0, 1.0), (0.01, 1.0)])
def test_wrong_units_are_suspected(desk: Desk, speed: float, force: float) -> None:
    (t, v), (t_w, w) = flown()
    surge = desk.surge(as_csv(desk.folder / "a.csv", (t, speed * v), (t_w, force * w)))
    assert not surge["identifiable"]
    assert any(code.startswith("implausible") for code in surge["reason_codes"])


def test_the_gain_of_our_own_thrusters_may_be_doubted_too(desk: Desk) -> None:
    bag = clone_root() / "test" / "replay" / "bags" / "yaw_replug"
    found = [desk.identified(bag, *words)["motions"]["yaw"] for words in ([], ["--gain-sigma", 0.3])]
    assumed, doubted = (yaw["added_mass"] for yaw in found)
    assert doubted["value"] == assumed["value"]
    assert doubted["std_calibrated"] > 2.0 * assumed["std_calibrated"]


@pytest.mark.parametrize(("words", "share"), [([], 0.1), (["--gain-sigma", 0.2], 0.2)])
def test_the_gain_of_a_wrench_is_never_taken_as_exact(desk: Desk, words: list[str], share: float) -> None:
    document = desk.of_small(desk.csv(gain=1.15, end_s=60.0), *words)
    k_q = document["motions"]["surge"]["k_q"]
    budget = document["motions"]["surge"]["budget"]["k_q"]
    assert budget["gain of the wrench"] == pytest.approx(share * k_q["value"], rel=0.1)
    # The rest is what thrusters may lose: the record has no coasts that would tell.
    assert 0.95 < k_q["std_calibrated"] / math.hypot(k_q["std"], share * k_q["value"]) < 1.5
    assert any("--gain-sigma" in one for one in document["assumptions"])


def test_stamps_of_others_leave_the_added_mass_in_doubt(desk: Desk) -> None:
    (t, v), forces = flown()
    late = desk.surge(as_csv(desk.folder / "a.csv", (t + 0.1, v), forces))
    assert abs(late["added_mass"]["value"] - TRUTH["added_mass"]) < 3.0 * late["added_mass"]["std"]


# ---- all axes together


def pilot_csv(folder: Path) -> Path:
    """Surge and sway that are flown at once, by the same thrust."""
    (t, v), (at, force) = flown(end_s=40.0)
    rows = [(one, f"{speed:.4f},{speed:.4f},,") for one, speed in zip(t, v, strict=True)]
    rows += [(one, f",,{newton:.4f},{newton:.4f}") for one, newton in zip(at, force, strict=True)]
    file = folder / "pilot.csv"
    file.write_text("\n".join(["t,u,v,X,Y", *(f"{one:.4f},{row}" for one, row in sorted(rows))]))
    return file


@pytest.mark.parametrize(
    ("words", "fitted"), [((), True), (("--no-joint",), False), (("--joint",), True), (("--dof", "surge"), False)]
)
def test_a_record_that_moves_axes_at_once_is_fitted_with_all_of_them_unless_told_otherwise(
    desk: Desk, words: tuple[str, ...], fitted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def refuses(*_arguments: object, **_more: object) -> None:
        asked.append(1)
        raise UsageError("no stretch is long enough")

    monkeypatch.setattr(identify, "identify_jointly", refuses)
    record = pilot_csv(desk.folder)
    if "--joint" in words:
        assert desk.refused(record, "--vehicle", desk.small, *words).endswith("no stretch is long enough")
    else:
        assumed = desk.of_small(record, *words)["assumptions"]
        together = [one for one in assumed if "all axes are fitted together too" in one]
        failed = [one for one in assumed if one == "no fit of all axes together: no stretch is long enough"]
        assert (len(together), len(failed)) == ((1, 1) if fitted else (0, 0))
    assert bool(asked) == fitted


# ---- several records


def test_several_records_are_pooled_and_their_spread_is_shown(desk: Desk) -> None:
    records = [as_csv(desk.folder / f"{seed}.csv", *flown(seed=seed)) for seed in range(2)]
    assert main(["identify", *map(str, records), "--vehicle", str(desk.small), "--json"]) == 0
    captured = desk.capsys.readouterr()
    assert "1.csv alone, 2 of 2" in captured.err
    document = json.loads(captured.out)
    pooled, runs = document["motions"]["surge"], [run["motions"]["surge"] for run in document["runs"]]
    assert is_true(pooled)
    assert len(runs) == 2
    assert pooled["samples"] > 1.8 * runs[0]["samples"]
    assert pooled["k_q"]["std"] < max(run["k_q"]["std"] for run in runs)
    assert document["spread"]["surge"]["k_q"]["runs"] == 2


def test_records_that_disagree_widen_the_band(desk: Desk) -> None:
    records = [desk.csv(), as_csv(desk.folder / "b.csv", *flown(k_q=90.0))]
    document = desk.of_small(*records)
    pooled = document["motions"]["surge"]["k_q"]
    assert document["spread"]["surge"]["k_q"]["ratio"] > 3.0
    assert abs(pooled["value"] - 78.0) < 15.0
    assert pooled["std"] > 3.0 * document["runs"][0]["motions"]["surge"]["k_q"]["std"]


# ---- bags


def header_of(t_s: float, frame: str) -> dict[str, Any]:
    return {"stamp": {"sec": int(t_s), "nanosec": int((t_s % 1.0) * 1e9)}, "frame_id": frame}


def pose_of(x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> dict[str, dict[str, float]]:
    turned = {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2.0), "w": math.cos(yaw / 2.0)}
    return {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turned}


def six(names: tuple[str, str], axis: int, value: float) -> dict[str, dict[str, float]]:
    flat = [value if i == axis else 0.0 for i in range(6)]
    return {name: dict(zip("xyz", part, strict=True)) for name, part in zip(names, (flat[:3], flat[3:]), strict=True)}


def velocity_message(
    kind: str, t_s: float, axis: int, value: float, frame: str, *, variance: float = 0.0
) -> dict[str, Any]:
    twist: dict[str, Any] = six(("linear", "angular"), axis, value)
    if not kind.endswith("/TwistStamped"):
        twist = {"twist": twist, "covariance": [variance if i % 7 == 0 else 0.0 for i in range(36)]}
    message: dict[str, Any] = {"header": header_of(t_s, frame), "twist": twist}
    if kind == ODOMETRY[0]:
        message |= {
            "header": header_of(t_s, "odom"),
            "child_frame_id": frame,
            "pose": {"pose": pose_of(), "covariance": [0.0] * 36},
        }
    return message


def wrench_message(kind: str, t_s: float, axis: int, value: float, frame: str) -> dict[str, Any]:
    wrench = six(("force", "torque"), axis, value)
    return wrench if kind.endswith("/Wrench") else {"header": header_of(t_s, frame), "wrench": wrench}


ODOMETRY = ("nav_msgs/msg/Odometry", "/odom", "base_link")
THRUST = ("geometry_msgs/msg/WrenchStamped", "/thrust", "base_link")
RC_OUT = "mavros_msgs/msg/RCOut"


def bag_of(path: Path, topics: Sequence[tuple[str, str, Iterable[tuple[float, Any]]]]) -> Path:
    """Bag of topics, each (type, name, [(seconds since START_S, content)])."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        schemas = {kind: writer.register_msgdef(kind, DEFINITIONS[kind]) for kind, _, _ in topics}
        rows = [(t, topic, schemas[kind], content) for kind, topic, reported in topics for t, content in reported]
        for t, topic, schema, content in sorted(rows, key=lambda row: row[0]):
            at = int((START_S + t) * 1e9)
            writer.write_message(topic, schema, content, log_time=at, publish_time=at)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
    return path


def reported(
    make: Callable[..., Any], topic: tuple[str, str, str], track: tuple[Array, Array], axis: int = 0, **more: float
) -> tuple[str, str, list[tuple[float, Any]]]:
    """A topic (type, name, frame) that tells values of one axis at their times."""
    kind, name, frame = topic
    rows = zip(*(column.tolist() for column in track), strict=True)
    return kind, name, [(t, make(kind, START_S + t, axis, value, frame, **more)) for t, value in rows]


def as_bag(
    path: Path,
    velocity: tuple[str, str, str] = ODOMETRY,
    wrench: tuple[str, str, str] = THRUST,
    *,
    axis: int = 0,
    signs: tuple[float, float] = (1.0, 1.0),
    extra: Sequence[Any] = (),
    variance: float = 0.0,
    end_s: float = 80.0,
) -> Path:
    (t_v, v), (t_w, w) = flown(end_s=end_s)
    velocities = reported(velocity_message, velocity, (t_v, signs[0] * v), axis, variance=variance)
    return bag_of(path, [*extra, velocities, reported(wrench_message, wrench, (t_w, signs[1] * w), axis)])


@pytest.mark.parametrize(
    "velocity",
    ["nav_msgs/msg/Odometry", "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/TwistWithCovarianceStamped"],
)
def test_every_type_of_velocity_serves(desk: Desk, velocity: str) -> None:
    bag = as_bag(desk.folder / "a.mcap", (velocity, "/a/velocity", "rov/base_link"))
    document = desk.of_small(bag, "--dof", "surge")
    assert document["motions"]["surge"]["identifiable"]
    assert is_true(document["motions"]["surge"])
    assert any("REP-103" in one for one in document["assumptions"])


def test_messages_that_nobody_can_decode_are_left_out_and_told(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    """A bag whose chunks have no checksum gives damaged bytes to the decoder."""
    bag, real, seen = as_bag(desk.folder / "a.mcap"), compression.unpacked, itertools.count()
    monkeypatch.setattr(bag_reader, "unpacked", lambda data: real(data)[:20] if next(seen) % 500 == 40 else real(data))
    document = desk.of_small(bag, "--dof", "surge")
    assert is_true(document["motions"]["surge"])
    assert any("is damaged" in one and "left out" in one for one in document["assumptions"])


def test_a_topic_of_which_nothing_can_be_decoded_is_named(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    bag, real = as_bag(desk.folder / "a.mcap"), compression.unpacked
    monkeypatch.setattr(bag_reader, "unpacked", lambda data: real(data)[:20])
    assert "none of the messages of /odom can be decoded" in desk.refused(bag, "--vehicle", desk.small)


def test_a_wrench_without_stamps_is_taken_by_its_times_of_receipt(desk: Desk) -> None:
    bag = as_bag(desk.folder / "a.mcap", wrench=("geometry_msgs/msg/Wrench", "/thrust", ""))
    document = desk.of_small(bag)
    assert desk.of_small(bag, "--dof", "all")["motions"].keys() == document["motions"].keys()
    assert is_true(document["motions"]["surge"])
    assert any("receipt" in one for one in document["assumptions"])


@pytest.mark.parametrize(
    ("frame", "sign"), [("base_link", -1.0), ("base_link_fsd", 1.0), ("rov_frd", 1.0), ("body_ned", 1.0)]
)
def test_frames_are_turned_into_sname(tmp_path: Path, frame: str, sign: float) -> None:
    bag = as_bag(tmp_path / "a.mcap", ("nav_msgs/msg/Odometry", "/odom", frame), axis=1, end_s=10.0)
    (found,) = read_bag(bag, TopicSelection(), topics_of(bag))
    (_, v), (_, w) = flown(end_s=10.0)
    assert found.velocity[:, 1] == pytest.approx(sign * v)
    assert found.wrench[:, 1] == pytest.approx(-w)


@pytest.mark.parametrize(
    ("world", "body", "sign"),
    [("world_ned", "rov/base_link", 1.0), ("odom", "base_link", -1.0), ("world_ned", "base_link_flu", -1.0)],
)
def test_in_a_world_with_z_down_the_body_has_z_down(tmp_path: Path, world: str, body: str, sign: float) -> None:
    """Stonefish's odometry: taken as z up, what floats was said to sink."""
    velocities, (t_w, w) = flown(end_s=10.0)
    kind, name, rows = reported(velocity_message, ("nav_msgs/msg/Odometry", "/odom", body), velocities, 2)
    for _, content in rows:
        content["header"]["frame_id"] = world
    thrust = reported(wrench_message, ("geometry_msgs/msg/WrenchStamped", "/thrust", body), (t_w, w), 2)
    bag = bag_of(tmp_path / "a.mcap", [(kind, name, rows), thrust])
    (found,) = read_bag(bag, TopicSelection(), topics_of(bag))
    assert found.velocity[:, 2] == pytest.approx(sign * velocities[1])
    assert found.wrench[:, 2] == pytest.approx(sign * w)
    assert any("the world of the odometry is 'world_ned'" in one for one in found.assumptions) == (sign > 0.0)


def stamped_again(path: Path, late: int | None = None) -> Path:
    """Two flights in one bag, whose stamps begin again with the second; one message may come late by 5 s."""
    velocities, thrusts = flown(end_s=40.0)
    topics = []
    for make, topic, (t, values) in ((velocity_message, ODOMETRY, velocities), (wrench_message, THRUST, thrusts)):
        kind, name, rows = reported(make, topic, (t, values))
        if late is not None and make is velocity_message:
            rows[late][1]["header"]["stamp"]["sec"] -= 5
        again = reported(make, topic, (t, values))[2]
        topics.append((kind, name, [*rows, *((at + 50.0, content) for at, content in again)]))
    return bag_of(path, topics)


@pytest.mark.parametrize("late", [None, 40])
def test_stamps_that_step_back_begin_a_record(tmp_path: Path, late: int | None) -> None:
    """A simulator that was reset: both flights were sorted into each other in silence."""
    bag = stamped_again(tmp_path / "a.mcap", late)
    found = read_bag(bag, TopicSelection(), topics_of(bag))
    (t_v, v), (t_w, w) = flown(end_s=40.0)
    assert [len(one.velocity_t) for one in found] == [len(t_v)] * 2
    assert [len(one.wrench_t) for one in found] == [len(t_w)] * 2
    assert found[1].velocity[:, 0] == pytest.approx(v)
    assert found[1].wrench[:, 0] == pytest.approx(w)
    assert "the stamps of /odom step back once: 2 records" in found[0].assumptions


def test_a_message_that_comes_late_begins_no_record(tmp_path: Path) -> None:
    velocities, thrusts = flown(end_s=40.0)
    kind, name, rows = reported(velocity_message, ODOMETRY, velocities)
    rows[40][1]["header"]["stamp"]["sec"] -= 5
    bag = bag_of(tmp_path / "a.mcap", [(kind, name, rows), reported(wrench_message, THRUST, thrusts)])
    (found,) = read_bag(bag, TopicSelection(), topics_of(bag))
    assert len(found.velocity_t) == len(velocities[0])


def test_mixed_frames_agree_after_turning(desk: Desk) -> None:
    fsd = ("geometry_msgs/msg/WrenchStamped", "/thrust", "base_link_fsd")
    bag = as_bag(desk.folder / "a.mcap", wrench=fsd, axis=1, signs=(-1.0, 1.0))
    sway = desk.of_small(bag)["motions"]["sway"]
    assert is_true(sway)


def test_a_frame_can_be_given(desk: Desk) -> None:
    world = ("geometry_msgs/msg/TwistStamped", "/velocity", "odom")
    bag = as_bag(desk.folder / "a.mcap", world)
    printed = desk.refused(bag, "--vehicle", desk.small)
    assert "--frame" in printed
    assert is_true(desk.surge(bag, "--frame", "flu"))


@pytest.mark.parametrize(("variance", "known"), [(0.01, True), (-1.0, False), (1e6, False)])
def test_a_velocity_that_is_marked_unknown_is_not_used(tmp_path: Path, variance: float, known: bool) -> None:
    kind = "geometry_msgs/msg/TwistWithCovarianceStamped"
    bag = as_bag(tmp_path / "a.mcap", (kind, "/velocity", "base_link"), end_s=5.0, variance=variance)
    assert np.isfinite(read_bag(bag, TopicSelection(), topics_of(bag))[0].velocity).all() == known


def test_rates_that_a_doppler_log_has_not_are_those_of_the_inertial_sensor(tmp_path: Path) -> None:
    """The zeros of its Twist were taken for rates: yaw "never changes" in a bag that held it."""
    t, rates = np.arange(0.0, 5.0, 0.02), 0.3 * np.sin(np.arange(0.0, 5.0, 0.02))
    vectors = {name: dict.fromkeys("xyz", 0.0) for name in ("angular_velocity", "linear_acceleration")}
    rows = [
        (at, {
            "header": header_of(START_S + at, "imu_link"), "orientation": pose_of()["orientation"],
            **{f"{name}_covariance": [0.0] * 9 for name in ("orientation", *vectors)},
            **vectors, "angular_velocity": {"x": 0.0, "y": 0.0, "z": rate},
        })
        for at, rate in zip(t.tolist(), rates.tolist(), strict=True)
    ]  # fmt: skip
    twist = ("geometry_msgs/msg/TwistStamped", "/dvl/twist", "dvl_link")
    bag = as_bag(tmp_path / "a.mcap", twist, end_s=5.0, extra=[("sensor_msgs/msg/Imu", "/imu", rows)])
    (found,) = read_bag(bag, TopicSelection(), topics_of(bag))
    known = np.isfinite(found.velocity[:, 5])
    assert found.velocity_t[known] == pytest.approx(t, abs=1e-6)
    assert found.velocity[known, 5] == pytest.approx(-rates)
    assert np.isfinite(found.velocity[~known, 0]).all()
    assert "/dvl/twist has no rates: those of /imu" in found.assumptions


def imu_rows(
    t: Array, rates: Array, angles: Array | None = None, frame: str = "imu_link"
) -> list[tuple[float, dict[str, Any]]]:
    """Of an inertial sensor that turns about its x axis, y left: rates [rad/s] and angles [rad]; None: it has none."""
    none, still = [0.0] * 9, dict.fromkeys("xyz", 0.0)
    attitude = {"orientation_covariance": [-1.0] * 9 if angles is None else none}
    rows = zip(t.tolist(), rates.tolist(), (np.zeros(len(t)) if angles is None else angles).tolist(), strict=True)
    return [
        (at, {
            "header": header_of(START_S + at, frame), **attitude,
            "orientation": {"x": math.sin(angle / 2.0), "y": 0.0, "z": 0.0, "w": math.cos(angle / 2.0)},
            "angular_velocity": {**still, "x": rate}, "angular_velocity_covariance": none,
            "linear_acceleration": still, "linear_acceleration_covariance": none,
        })
        for at, rate, angle in rows
    ]  # fmt: skip


IMU_S = array(np.arange(0.0, 5.0, 0.02))
ROLL_rad, ROLL_radps = array(0.2 * np.sin(2.0 * IMU_S)), array(0.4 * np.cos(2.0 * IMU_S))
INERTIAL = "sensor_msgs/msg/Imu"


def doppler_rows(kind: str, t: Array, v: Array, lost: Sequence[int] = ()) -> tuple[str, str, list[tuple[float, Any]]]:
    """Reports of a Doppler log that moves to starboard; `lost`: which of them say that they are no velocity."""

    def said(k: int) -> dict[str, Any]:
        if kind.startswith("marine"):
            return {"velocity_mode": 1 if k % 2 else 3, "velocity_covar": [-1.0 if k % 2 else 1e-4] + [0.0] * 8}
        return {"fom": 0.01, "altitude": 2.0, "velocity_valid": False}

    good = {"velocity_mode": 1, "velocity_covar": [1e-4] + [0.0] * 8} if kind.startswith("marine") else {
        "fom": 0.01, "altitude": 2.0, "velocity_valid": True,
    }  # fmt: skip
    rows = [
        (at, {
            "header": header_of(START_S + at, "dvl_link"), "velocity": {"x": 0.0, "y": value, "z": 0.0},
            **(said(k) if k in lost else good),
        })
        for k, (at, value) in enumerate(zip(t.tolist(), v.tolist(), strict=True))
    ]  # fmt: skip
    return kind, "/dvl/data", rows


@pytest.mark.parametrize("kind", ["marine_acoustic_msgs/msg/Dvl", "dvl_msgs/msg/DVL"])
def test_reports_of_a_doppler_log_are_velocities_in_its_axes(tmp_path: Path, kind: str) -> None:
    """Beside an inertial sensor, which has what the log has not: rates, roll and pitch."""
    (t, v), (t_w, w) = flown(end_s=5.0)
    thrust = reported(wrench_message, THRUST, (t_w, -w), 1)
    sensor = (INERTIAL, "/imu/data", imu_rows(IMU_S, ROLL_radps, ROLL_rad))
    raw = (INERTIAL, "/imu/data_raw", imu_rows(IMU_S, array(9.0 * ROLL_radps)))
    bag = bag_of(tmp_path / "a.mcap", [doppler_rows(kind, t, v, (3, 4)), thrust, sensor, raw])
    (found,) = read_bag(bag, TopicSelection(), topics_of(bag))
    assert found.velocity[np.isfinite(found.velocity[:, 1]), 1] == pytest.approx(np.delete(v, [3, 4]))
    assert found.wrench[:, 1] == pytest.approx(w), "a wrench of REP-103, turned to starboard"
    assert found.velocity[np.isfinite(found.velocity[:, 3]), 3] == pytest.approx(ROLL_radps)
    assert found.attitude[:, 0] == pytest.approx(ROLL_rad, abs=1e-6)
    assert found.attitude_t == pytest.approx(IMU_S, abs=1e-6)
    assert "/dvl/data: axes of the instrument, x forward, y starboard, z down" in found.assumptions


def test_what_a_navigator_made_of_a_doppler_log_comes_first(tmp_path: Path) -> None:
    bag = as_bag(tmp_path / "a.mcap", end_s=5.0, extra=[doppler_rows("dvl_msgs/msg/DVL", *flown(end_s=5.0)[0])])
    (found,) = read_bag(bag, TopicSelection(), topics_of(bag))
    assert np.isfinite(found.velocity[:, 0]).all()
    assert not found.velocity[:, 1].any()
    (named,) = read_bag(bag, TopicSelection(odometry="/dvl/data"), topics_of(bag))
    assert named.velocity[:, 1].any()


@pytest.mark.parametrize(
    ("angles", "said"),
    [(array(-ROLL_rad), True), (array(0.0 * ROLL_rad), False), (None, False)],
    ids=["of another axis", "a constant", "none"],
)
def test_an_orientation_that_is_none_is_no_attitude(tmp_path: Path, angles: Array | None, said: bool) -> None:
    twist = ("geometry_msgs/msg/TwistStamped", "/dvl/twist", "dvl_link")
    sensor = (INERTIAL, "/imu", imu_rows(IMU_S, ROLL_radps, angles))
    (found,) = read_bag(
        bag := as_bag(tmp_path / "a.mcap", twist, end_s=5.0, extra=[sensor]), TopicSelection(), topics_of(bag)
    )
    assert len(found.attitude_t) == 0
    assert found.velocity[np.isfinite(found.velocity[:, 3]), 3] == pytest.approx(ROLL_radps)
    note = "/imu: its orientation does not change as its rates say, and is not used"
    assert (note in found.assumptions) == said


@pytest.mark.parametrize("unit", [1.0, 0.01], ids=["pascal", "hectopascal"])
def test_without_a_velocity_of_heave_the_pressure_of_the_water_gives_depths(tmp_path: Path, unit: float) -> None:
    """A BlueROV2 without a DVL: an inertial sensor, a Bar30, and the air in its hull, which the sun warms."""
    depth_m = 1.0 + 0.5 * np.sin(IMU_S)
    pressures = {"/bar30/pressure": unit * (101325.0 + 9806.65 * depth_m), "/imu/static_pressure": 1e5 + 2e3 * IMU_S}
    topics = [
        ("sensor_msgs/msg/FluidPressure", name, [
            (at, {"header": header_of(START_S + at, ""), "fluid_pressure": value, "variance": 0.0})
            for at, value in zip(IMU_S.tolist(), values.tolist(), strict=True)
        ])
        for name, values in pressures.items()
    ]  # fmt: skip
    thrust = reported(wrench_message, THRUST, flown(end_s=5.0)[1], 2)
    bag = bag_of(tmp_path / "a.mcap", [(INERTIAL, "/imu", imu_rows(IMU_S, ROLL_radps, ROLL_rad)), thrust, *topics])
    (found,) = read_bag(bag, TopicSelection(odometry="/imu"), topics_of(bag))
    known = np.isfinite(found.attitude[:, 2])
    assert found.attitude[known, 2] == pytest.approx(depth_m, abs=1e-3)
    assert found.attitude[~known, 0] == pytest.approx(ROLL_rad, abs=1e-6)
    by_size = "" if unit == 1.0 else ", taken as hectopascal by their size"
    assert f"depths follow from the pressures of /bar30/pressure{by_size}" in found.assumptions


def test_heave_of_a_bag_without_a_dvl_follows_from_the_pressure(desk: Desk) -> None:
    (t, v), (t_w, force) = flown(noise=0.0)
    depth_m = 2.0 + np.cumsum(np.diff(t, prepend=t[0]) * v) + np.random.default_rng(2).normal(0.0, 0.003, len(t))
    rows = [
        (at, {"header": header_of(START_S + at, ""), "fluid_pressure": 101325.0 + 9806.65 * one, "variance": 0.0})
        for at, one in zip(t.tolist(), depth_m.tolist(), strict=True)
    ]
    floats_N = load_vehicle(desk.small).net_buoyancy_N
    thrust = reported(wrench_message, THRUST, (t_w, -(force + floats_N)), 2)
    pressure = ("sensor_msgs/msg/FluidPressure", "/bar30/pressure", rows)
    bag = bag_of(desk.folder / "a.mcap", [(INERTIAL, "/imu", imu_rows(t, array(0.0 * t))), thrust, pressure])
    heave = desk.of_small(bag, "--odometry", "/imu")["motions"]["heave_down"]
    assert heave["identifiable"]
    assert is_true(heave)


def test_two_inertial_sensors_that_know_as_much_leave_it_open(tmp_path: Path) -> None:
    twist = ("geometry_msgs/msg/TwistStamped", "/dvl/twist", "dvl_link")
    both = [(INERTIAL, name, imu_rows(IMU_S, ROLL_radps)) for name in ("/a", "/b")]
    (found,) = read_bag(
        bag := as_bag(tmp_path / "a.mcap", twist, end_s=5.0, extra=both), TopicSelection(), topics_of(bag)
    )
    assert not np.isfinite(found.velocity[:, 3:]).any()
    note = "/dvl/twist has no rates, and it is not clear which of /a, /b to take: none; record one of them"
    assert note in found.assumptions


def test_several_topics_are_ambiguous_until_one_is_named(desk: Desk) -> None:
    still = (np.zeros(1), np.zeros(1))
    other = reported(velocity_message, ("geometry_msgs/msg/TwistStamped", "/cmd_vel", "base_link"), still)
    bag = as_bag(desk.folder / "a.mcap", extra=[other])
    printed = desk.refused(bag, "--vehicle", desk.small)
    assert "/cmd_vel" in printed
    assert "/odom" in printed
    assert "--odometry" in printed
    assert is_true(desk.surge(bag, "--odometry", "/odom"))


@pytest.mark.parametrize(
    ("words", "wanted"),
    [(["--odometry", "/nothing"], "no such topic"), (["--wrench", "/odom"], "nav_msgs/msg/Odometry")],
)
def test_a_topic_that_does_not_serve_is_refused_with_what_is_there(desk: Desk, words: list[str], wanted: str) -> None:
    bag = as_bag(desk.folder / "a.mcap", end_s=5.0)
    printed = desk.refused(bag, *words)
    assert wanted in printed
    assert "/thrust" in printed


def test_a_bag_without_forces_lists_what_it_holds(desk: Desk) -> None:
    still = reported(velocity_message, ODOMETRY, (np.zeros(1), np.array([0.1])))
    printed = desk.refused(bag_of(desk.folder / "a.mcap", [still]))
    assert "no topic holds the force" in printed
    assert "/odom (nav_msgs/msg/Odometry)" in printed


def test_sqlite_bags_open_too(desk: Desk) -> None:
    mcap = as_bag(desk.folder / "a.mcap", end_s=40.0)
    bag = desk.folder / "a.db3"
    with sqlite3.connect(bag) as base:
        base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)")
        base.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)")
        base.execute(
            "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT, encoding TEXT, "
            "encoded_message_definition TEXT)"
        )
        numbers: dict[str, int] = {}
        for message in messages(mcap):
            if message.topic not in numbers:
                numbers[message.topic] = len(numbers) + 1
                row = (numbers[message.topic], message.topic, message.type)
                base.execute("INSERT INTO topics VALUES(?, ?, ?, 'cdr')", row)
                text = (row[0], message.type, DEFINITIONS[message.type])
                base.execute("INSERT INTO message_definitions VALUES(?, ?, 'ros2msg', ?)", text)
            received = (numbers[message.topic], message.received, message.data)
            base.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", received)
    assert set(desk.of_small(bag)["motions"]) == {"surge"}
    (read,), (wanted,) = (read_bag(one, TopicSelection(), topics_of(one)) for one in (bag, mcap))
    assert np.array_equal(read.velocity, wanted.velocity)
    assert np.array_equal(read.wrench, wanted.wrench)


# ---- what is not there can be made


def pulses_bag(path: Path, channels: list[int]) -> Path:
    """Velocities, and pulses in place of forces."""
    velocities, (t_w, _) = flown(end_s=10.0)
    pulses = [(t, {"header": header_of(START_S + t, ""), "channels": channels}) for t in t_w.tolist()]
    return bag_of(path, [reported(velocity_message, ODOMETRY, velocities), (RC_OUT, "/mavros/rc/out", pulses)])


def test_pulses_become_forces_by_the_curves_of_the_vehicle_file(tmp_path: Path) -> None:
    bag = pulses_bag(tmp_path / "a.mcap", [1700, 1700, 0, 0, 1500, 1500, 1500, 1500])
    vehicle = load_vehicle(default_vehicle())
    (found,) = read_bag(bag, TopicSelection(wrench="/mavros/rc/out"), topics_of(bag), vehicle)
    branch = vehicle.curves["main"].negative
    assert found.wrench[:, 0] == pytest.approx(-2.0 * math.cos(math.radians(55.0)) * branch.force_N(1300.0))
    assert found.wrench[:, 1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("channels", "words", "wanted"),
    [
        ([1700] * 8, [], "name it with --wrench"),
        ([1700] * 8, ["--wrench", "/mavros/rc/out"], "name a vehicle file with thrusters"),
        ([1700] * 6, ["--wrench", "/mavros/rc/out", "--vehicle", default_vehicle()], "holds 6 channels, wanted 8"),
        (
            [1] * 8,
            ["--wrench", "/mavros/rc/out", "--vehicle", default_vehicle()],
            "found a pulse of 1 us, wanted ",
        ),
    ],
)
def test_pulses_that_do_not_serve_are_refused_with_the_remedy(
    desk: Desk, channels: list[int], words: list[str], wanted: str
) -> None:
    assert wanted in desk.refused(pulses_bag(desk.folder / "a.mcap", channels), *words)


def own_message_bag(path: Path, values: list[float]) -> Path:
    """Velocities, and an array in a message that only this vehicle has."""
    velocities, (t_w, _) = flown(end_s=10.0)
    rows = [(t, {"header": header_of(START_S + t, ""), "set": {"throttle": values}, "mode": "x"}) for t in t_w.tolist()]
    return bag_of(path, [reported(velocity_message, ODOMETRY, velocities), ("my_msgs/msg/Escs", "/escs", rows)])


FORWARD = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("named", "values"),
    [
        ("/escs:set.throttle=ratio", [-0.5 * one for one in FORWARD]),
        ("/escs:set.throttle=N", [-1.0 * one for one in FORWARD]),
        ("/escs:set.throttle=us", [1500.0 + 200.0 * one for one in FORWARD]),
        ("/escs:set.throttle", [1500.0 + 200.0 * one for one in FORWARD]),
    ],
)
def test_arrays_of_any_message_become_forces_by_field_and_unit(tmp_path: Path, named: str, values: list[float]) -> None:
    bag = own_message_bag(tmp_path / "a.mcap", values)
    vehicle = load_vehicle(default_vehicle())
    (found,) = read_bag(bag, TopicSelection(wrench=named), topics_of(bag), vehicle)
    first = thrust_curves(vehicle)[0]
    low, high = sorted(first.pulse(force) for force in first.range_N)
    force = {
        "ratio": first.force(first.stop_us - 0.5 * (first.stop_us - low)),
        "N": -1.0,
    }.get(named.partition("=")[2], first.force(1700.0))
    assert low < 1700.0 < high
    assert found.wrench[:, 0] == pytest.approx(2.0 * math.cos(math.radians(55.0)) * force)


@pytest.mark.parametrize(
    ("named", "values", "wanted"),
    [
        ("/escs:set.throttle", FORWARD, "name their unit: --wrench /escs:set.throttle=N for newtons"),
        ("/escs:set.throttle=ratio", [2.0] * 8, "holds 2, wanted shares of full throttle from -1 to 1"),
        ("/escs:set.throttle=rpm", FORWARD, "found the unit 'rpm', wanted one of us, N, ratio"),
        ("/escs:set.speed=N", FORWARD, "has no 'speed' at 'set.speed'; there are throttle"),
        ("/escs:mode=N", FORWARD, "mode is str, wanted an array of numbers"),
        ("/escs:set.throttle=N", FORWARD[:3], "holds 3 channels, wanted 8"),
        ("/ecs:set.throttle=N", FORWARD, "found no such topic"),
    ],
)
def test_arrays_that_do_not_serve_are_refused_with_what_is_there(
    desk: Desk, named: str, values: list[float], wanted: str
) -> None:
    bag = own_message_bag(desk.folder / "a.mcap", values)
    assert wanted in desk.refused(bag, "--vehicle", default_vehicle(), "--wrench", named)


def test_poses_alone_give_the_velocity(desk: Desk) -> None:
    true = flight((3.0, 6.0, 10.0, 14.0), 80.0, 5.0, 66.48)
    _, forces = flown()
    yaw = math.radians(60.0)
    rows = zip(true.grid.times_s[::4].tolist(), true.path.s[::4].tolist(), strict=True)
    poses = [(t, pose_of(s * math.cos(yaw), s * math.sin(yaw), yaw)) for t, s in rows]
    stamped = [(t, {"header": header_of(START_S + t, "mocap"), "pose": pose}) for t, pose in poses]
    mocap = ("geometry_msgs/msg/PoseStamped", "/mocap/rov", stamped)
    bag = bag_of(desk.folder / "a.mcap", [mocap, reported(wrench_message, THRUST, forces)])
    assert "--odometry" in desk.refused(bag, "--vehicle", desk.small)
    surge = desk.surge(bag, "--odometry", "/mocap/rov")
    assert surge["identifiable"]
    assert force_at(surge, 0.4) == pytest.approx(force_at({k: {"value": v} for k, v in TRUTH.items()}, 0.4), rel=0.02)


def test_velocities_in_the_axes_of_the_world_are_found_out(desk: Desk) -> None:
    """The vehicle heads east, and its frames say of a velocity along y that it is one of the body."""
    true = flight((3.0, 6.0, 10.0, 14.0), 80.0, 5.0, 66.48)
    (t, v), forces = flown()
    kind, name, rows = reported(velocity_message, ODOMETRY, (t, v), axis=1)
    for (_, message), s in zip(rows, true.path.s[::20].tolist(), strict=True):
        message["pose"] = {"pose": pose_of(0.0, s, math.pi / 2.0), "covariance": [0.0] * 36}
    bag = bag_of(desk.folder / "a.mcap", [(kind, name, rows), reported(wrench_message, THRUST, forces)])
    document = desk.of_small(bag)
    assert is_true(document["motions"]["surge"])
    assert any("axes of the world" in one for one in document["assumptions"])


# ---- logs of autopilots


def px4_log(vehicle: Vehicle, surge: Drag, mass_kg: float) -> Iterator[tuple[str, int, tuple[float, ...]]]:
    """Surge of a vehicle whose battery sags from 16.5 V to 13.5 V, heading north-east: 150 s of a log of PX4."""
    rng, v, step_s = np.random.default_rng(5), 0.0, 0.05
    for step in range(3000):
        at_us, volts = 50_000 * step, 16.5 - 0.001 * step
        pulses = ardusub.outputs("surge", (0.5, -0.5, 0.25, -0.25, -0.4, 0.4)[step // 80 % 6])
        if step % 100 == 0:  # 5 s: the curves are made for a voltage, and it falls slowly
            applied = AppliedWrench(vehicle, volts - 0.05)
        v += step_s * (applied.wrench(applied.forces_N(pulses))[0] - surge.k_q * abs(v) * v - surge.k_l * v) / mass_kg
        seen, late_us = math.sqrt(0.5) * (v + rng.normal(0.0, 0.01)), at_us + 50_000
        yield "vehicle_attitude", 0, (late_us, late_us, math.cos(math.pi / 8), 0.0, 0.0, math.sin(math.pi / 8))
        yield "vehicle_local_position", 0, (late_us, late_us, seen, seen, 0.0, True, True)
        yield "actuator_outputs", 0, (at_us, *pulses, *[0] * 8)
        yield "battery_status", 0, (at_us, volts)


def test_a_log_of_px4_is_identified_at_the_logged_voltage(desk: Desk) -> None:
    vehicle, file = load_vehicle(ardusub.HEAVY), desk.folder / "dive.ulg"
    water = vehicle.hydrodynamics
    assert water is not None
    file.write_bytes(b"".join(ulog(px4_log(vehicle, water.surge, vehicle.mass_kg + water.added_mass[0]))))
    document = desk.identified(file, "--vehicle", ardusub.HEAVY)
    assert list(document["motions"]) == ["surge"], "rounding in sway was taken for motion"
    assert "joint" not in document, "pitch by the thrusters below the center was counted, in a log without rates"
    surge = document["motions"]["surge"]
    assert surge["identifiable"]
    true = {"k_q": {"value": water.surge.k_q}, "k_l": {"value": water.surge.k_l}}
    assert force_at(surge, 0.5) == pytest.approx(force_at(true, 0.5), rel=0.03)
    assert any("13.5 to 16.5 V" in one for one in document["assumptions"])


# ---- wrong use


def test_a_record_that_does_not_exist(desk: Desk) -> None:
    assert "does not exist" in desk.refused(desk.folder / "none.mcap")


@pytest.mark.parametrize(
    ("words", "wanted"), [(["--from", 50], "the record lasts"), (["--from", 5, "--to", 2], "--to")]
)
def test_a_span_that_the_record_does_not_hold(desk: Desk, words: list[object], wanted: str) -> None:
    assert wanted in desk.refused(desk.csv(end_s=5.0), *words)


def test_an_aborted_run_reports_it_whoever_shows_it(desk: Desk) -> None:
    bag = desk.folder / "run" / "bag"
    shutil.copytree(clone_root() / "test" / "replay" / "bags" / "surge", bag)
    assert main(["identify", str(desk.folder / "run")]) == 0
    # The pilot tells of no end: the record was cut off in flight, as by a power cut.
    assert "aborted by record: it ends within the maneuver (surge, plateau);" in desk.capsys.readouterr().err
    (desk.folder / "run" / "coefficients.yaml").write_text("aborted: 'operator: stopped by Ctrl-C'\nmotions: {}\n")
    assert main(["identify", str(desk.folder / "run"), "--coefficients", str(desk.folder / "again.yaml")]) == 0
    printed_text = "aborted by operator: stopped by Ctrl-C; the results are of the part flown until then\n"
    assert printed_text in desk.capsys.readouterr().err
    assert read_coefficients(desk.folder / "again.yaml").conditions.aborted == "operator: stopped by Ctrl-C"
    document = desk.identified(bag)
    assert (document["aborted"], document["aborted_by"]) == ("operator: stopped by Ctrl-C", "operator")


def test_a_span_of_our_own_bag_in_which_nothing_was_flown(desk: Desk) -> None:
    assert "no motion was flown from 900 s" in desk.refused(
        clone_root() / "test" / "replay" / "bags" / "pitch_reset", "--from", 900
    )


def test_our_own_bag_without_a_maneuver_is_called_so(desk: Desk) -> None:
    flown = clone_root() / "test" / "replay" / "bags" / "surge"
    bag = recover(flown, desk.folder / "bag", keep=lambda topic, _: topic != resolved(MANEUVER)).output
    printed = desk.refused(bag)
    assert "is a bag of this stack, and no maneuver was flown in it" in printed
    assert "--odometry /hindrax/navigation/odometry" in printed


@pytest.mark.parametrize(("latency_s", "printed_text"), [(0.07, "0.07 s too late"), (-0.07, "0.07 s too early")])
def test_velocities_come_late_or_early(latency_s: float, printed_text: str) -> None:
    assert identify._delays(0.01, latency_s) == f"thrust 0.01 s; velocity stamps {printed_text}"


def test_without_a_vehicle_file_the_assumption_is_reported(desk: Desk) -> None:
    document = desk.identified(desk.csv())
    assert any("--vehicle" in one for one in document["assumptions"])
    assert main(["identify", str(desk.csv())]) == 0
    assert "COB-2023" not in desk.capsys.readouterr().out, "the paper stands beside its own vehicle only"
    assert "added_mass" not in document["motions"]["surge"]
    assert math.isclose(document["motions"]["surge"]["k_q"]["value"], TRUTH["k_q"], rel_tol=0.05)


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["identify", "RECORD", "--report", "none/a.html"], 1),
        (["identify", "RECORD", "--coefficients", "none/a.yaml"], 1),
        (["predict", "RECORD", "RECORD", "--plot", "none/a.png"], 2),
        (["bag", "plot", "RECORD", "/a:b", "--out", "none/a.png"], 1),
    ],
)
def test_a_place_that_cannot_be_written_is_reported_before_the_work(desk: Desk, words: list[str], code: int) -> None:
    place = {"RECORD": "no-record", words[-1]: str(desk.folder / words[-1])}
    assert main([place.get(word, word) for word in words]) == code
    printed = desk.capsys.readouterr().err
    assert f"{words[-1]}: cannot be written (No such file or directory)" in printed
    assert "no-record" not in printed


def test_what_is_no_record_is_told_which_files_are(desk: Desk, tmp_path: Path) -> None:
    letter = tmp_path / "README.md"
    letter.write_text("# Read me\n", encoding="utf-8")
    assert main(["identify", str(letter)]) == 2
    told = desk.capsys.readouterr().err
    for ending in (".mcap", ".csv", ".bin", ".ulg"):
        assert ending in told


def test_a_bag_of_another_vehicle_than_the_named_one_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    bag = str(clone_root() / "test" / "replay" / "bags" / "surge")
    assert main(["identify", bag, "--vehicle", "bluerov2"]) == 0
    assert "the record is of hindrax, --vehicle names bluerov2" in " ".join(capsys.readouterr().err.split())
    assert main(["identify", bag, "--vehicle", "hindrax"]) == 0
    assert "the record is of" not in capsys.readouterr().err


@pytest.mark.parametrize(("frame", "count", "x_m"), [(1, 6, 0.0), (2, 8, 0.25)])
def test_the_file_of_a_simulator_is_of_what_it_simulates(
    frame: int, count: int, x_m: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """SIM_Submarine: vertical thrusters at 0.25 m along both axes, or abeam; no thrust is lost, added mass is none."""
    log, made = tmp_path / "sitl.bin", tmp_path / "mine.yaml"
    outputs = {f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, count + 1)}
    log.write_bytes(dataflash_of_yaw({"FRAME_CONFIG": float(frame), "SIM_BUOYANCY": 1.0} | outputs))
    assert main(["vehicle", "new", "mine", "--from", str(log), "--out", str(made)]) == 0
    (shown,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("  ./hindrax vehicle show "))
    assert main(["vehicle", "show", *shown.split()[3:]]) == 0, "the next command finds the file where --out put it"
    vehicle = load_vehicle(made)
    assert (vehicle.name, vehicle.losses, len(vehicle.thrusters)) == ("mine", False, count)
    assert vehicle.thrusters[4].position_m == (x_m, 0.25, 0.0)
    assert vehicle.measuring("velocity") == ("estimator",)


def test_the_log_of_an_ardusub_says_which_vehicle_it_is_of(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`identify dive.bin` and no other file; and the vehicle file that `vehicle new --from` makes of it."""
    log = tmp_path / "dive.bin"
    parameters = {"FRAME_CONFIG": 2.0, "MOT_4_DIRECTION": -1.0} | {f"SERVO{n}_FUNCTION": 32.0 + n for n in range(1, 9)}
    log.write_bytes(dataflash_of_yaw(parameters))
    assert main(["identify", str(log)]) in (0, 1)
    told = capsys.readouterr().err
    assert "the log's frame belongs to bluerov2-heavy, whose hull is assumed" in told
    assert "name no outputs" not in told
    made = tmp_path / "mine.yaml"
    assert main(["vehicle", "new", "mine", "--from", str(log), "--out", str(made)]) == 0
    vehicle = load_vehicle(made)
    assert vehicle.name == "mine"
    assert [one.name for one in vehicle.thrusters if one.reversed] == ["T4"]
    assert "simulator" not in told + capsys.readouterr().err + made.read_text()
    log.write_bytes(dataflash_of_yaw(parameters | {"SIM_BUOYANCY": 1.0}))
    capsys.readouterr()
    assert main(["identify", str(log), "--vehicle", "bluerov2-heavy"]) in (0, 1)
    told = " ".join(capsys.readouterr().err.split())
    assert "ArduPilot's simulator, whose thrust, levers and water are not those of bluerov2-heavy" in told
    assert "`./hindrax vehicle new NAME --from LOG` makes the file of its vehicle" in told
    assert main(["identify", str(log), "--coefficients", str(tmp_path / "sitl.yaml")]) in (0, 1)
    assert "ArduPilot's simulator, whose own vehicle is assumed" in " ".join(capsys.readouterr().err.split())
    assert read_coefficients(tmp_path / "sitl.yaml").conditions.vehicle == "ardusub-sitl"
    log.write_bytes(dataflash_of_yaw({"FRAME_CONFIG": 5.0}))
    assert main(["vehicle", "new", "other", "--from", str(log), "--out", str(tmp_path / "o.yaml")]) == 2
    told = " ".join(capsys.readouterr().err.split())
    assert "found FRAME_CONFIG 5, wanted an ArduSub with the frame 1" in told
    assert "describe its thrusters by hand (docs/how-to/new-vehicle.md" in told
    assert "ten questions" not in told, "they know no such frame"
    assert main(["identify", str(log)]) == 2
    assert "name no outputs (SERVOn_FUNCTION): the outputs of the vehicle file are assumed" in (
        told := capsys.readouterr().err
    )
    assert "FRAME_CONFIG is 5, wanted one of a vehicle in the box, 1 (bluerov2), 2 (" in told


def dataflash_of_yaw(parameters: dict[str, float]) -> bytes:
    """A DataFlash log of an ArduSub without a DVL that yaws: parameters, attitude, rates and pulses."""
    formats = {
        "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns", "<BB4s16s64s"),
        "PARM": (1, "QNf", "TimeUS,Name,Value", "<Q16sf"),
        "ATT": (2, "Qccc", "TimeUS,Roll,Pitch,Yaw", "<Qhhh"),
        "IMU": (3, "QBfff", "TimeUS,I,GyrX,GyrY,GyrZ", "<QBfff"),
        "RCOU": (4, "Q" + "H" * 8, "TimeUS," + ",".join(f"C{n}" for n in range(1, 9)), "<Q8H"),
    }

    def packed(name: str, *values: float | bytes) -> bytes:
        return b"\xa3\x95" + bytes([formats[name][0]]) + struct.pack(formats[name][3], *values)

    log = [
        packed("FMT", number, 3 + struct.calcsize(layout), name.encode(), kinds.encode(), columns.encode())
        for name, (number, kinds, columns, layout) in formats.items()
    ]
    log += [packed("PARM", 1_000_000, name.encode(), value) for name, value in parameters.items()]
    for step in range(400):
        at_us, turning = 1_000_000 + 50_000 * step, 1 if step // 80 % 2 else -1
        log.append(packed("ATT", at_us, 0, 0, 0))
        log.append(packed("IMU", at_us, 0, 0.0, 0.0, 0.5 * turning))
        log.append(packed("RCOU", at_us, *(1500 + 80 * turning * side for side in (-1, 1, -1, 1)), *[1500] * 4))
    return b"".join(log)
