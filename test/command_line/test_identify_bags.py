"""`identify` over bags of others: MCAP, sqlite3, any topics and frames."""

import itertools
import math
import sqlite3
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from identify_desk import START_S, TRUTH, Desk, desk, flight, flown, force_at, is_true, reported
from mcap_ros2.writer import Writer

from hindrax_analysis.records.third_party_bag import TopicSelection, read_bag, topics_of
from hindrax_bag.read import bag_reader, compression
from hindrax_bag.read.bag_reader import messages
from hindrax_bringup.share_files import default_vehicle
from hindrax_control.allocation.thrust_curve import AppliedWrench, thrust_curves
from hindrax_core.signals import Supply
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.arrays import Array, array

__all__ = ["desk"]
"""A fixture of all tests."""

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
    "my_msgs/msg/Stamped": f"{STAMPED}float64 data\n{PARTS}",
    "std_msgs/msg/Float64": "float64 data\n",
    "sensor_msgs/msg/BatteryState": f"{STAMPED}float32 voltage\n{PARTS}",
    "mavros_msgs/msg/RCOut": f"{STAMPED}uint16[] channels\n{PARTS}",
    "my_msgs/msg/Escs": f"{STAMPED}Set set\nstring mode\n{PARTS}{'=' * 80}\nMSG: my_msgs/Set\nfloat32[] throttle\n",
}


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


def test_a_record_without_a_measured_velocity_says_what_counts_as_none(desk: Desk) -> None:
    bag = as_bag(desk.folder / "a.mcap", end_s=10.0, variance=-1.0)
    assert "of a variance below 0 or of 1000 and more, counts as not measured" in desk.refused(bag)


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


def test_a_pose_that_nobody_has_filled_in_is_no_attitude(tmp_path: Path) -> None:
    """The Odometry of a Doppler log has the pose of an empty message: roll and pitch stayed zero beside a sensor."""
    sensor = (INERTIAL, "/imu", imu_rows(IMU_S, ROLL_radps, ROLL_rad))
    bag = as_bag(tmp_path / "a.mcap", (ODOMETRY[0], "/dvl/odometry", "dvl_link"), end_s=5.0, extra=[sensor])
    (found,) = read_bag(bag, TopicSelection(), topics_of(bag))
    assert found.attitude[:, 0] == pytest.approx(ROLL_rad, abs=1e-6)


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
    ("volts", "supply_V", "note"),
    [
        ((12.0, 12.0), 12.0, "thrust follows the curves at the logged 12.0 to 12.0 V"),
        ((0.0, 0.0), None, "no supply voltage is logged"),
        ((), None, "no supply voltage is logged"),
    ],
    ids=["measured", "not wired", "not recorded"],
)
def test_pulses_become_forces_at_the_voltage_of_the_bag_s_battery(
    tmp_path: Path, volts: tuple[float, ...], supply_V: float | None, note: str
) -> None:
    """At the file's in silence, they were a fifth too large for a battery that is half empty."""
    vehicle = load_vehicle(default_vehicle())
    velocities, (t_w, _) = flown(end_s=10.0)
    pulses = [(t, {"header": header_of(START_S + t, ""), "channels": [1700] * 8}) for t in t_w.tolist()]
    battery = [(5.0 * at, {"header": header_of(START_S + at, ""), "voltage": one}) for at, one in enumerate(volts)]
    topics = [reported(velocity_message, ODOMETRY, velocities), (RC_OUT, "/mavros/rc/out", pulses)]
    if battery:
        topics.append(("sensor_msgs/msg/BatteryState", "/mavros/battery", battery))
    bag = bag_of(tmp_path / "a.mcap", topics)
    (found,) = read_bag(bag, TopicSelection(wrench="/mavros/rc/out"), topics_of(bag), vehicle)
    assert found.forces[5] == pytest.approx(AppliedWrench(vehicle, supply_V).forces_N([1700.0] * 8))
    assert found.supply is (Supply.MEASURED if supply_V else Supply.ASSUMED)
    assert any(note in one for one in found.assumptions)


@pytest.mark.parametrize("since_s", [-4.0, 1.0, 4.0], ids=["before the flight", "in it", "twice"])
def test_pulses_whose_stamps_begin_again_are_those_of_the_same_times(tmp_path: Path, since_s: float) -> None:
    """SERVO_OUTPUT_RAW counts microseconds in 32 bits: after 71.6 minutes MAVROS stamps the outputs anew."""
    vehicle, wrap_s = load_vehicle(default_vehicle()), 2**32 * 1e-6
    velocities, (t_w, _) = flown(end_s=10.0)

    def read(stamped: Array, name: str) -> Any:
        rows = [
            (t, {"header": header_of(at, ""), "channels": [1700 + 10 * int(t)] * 8})
            for t, at in zip(t_w.tolist(), (START_S + stamped).tolist(), strict=True)
        ]
        bag = bag_of(
            tmp_path / name, [reported(velocity_message, ODOMETRY, velocities), (RC_OUT, "/mavros/rc/out", rows)]
        )
        (found,) = read_bag(bag, TopicSelection(wrench="/mavros/rc/out"), topics_of(bag), vehicle)
        return found

    times = np.where(t_w > since_s, 2.0 if since_s == 4.0 else 1.0, 0.0)
    found, wanted = read(array(t_w - wrap_s * times), "wrapped.mcap"), read(array(t_w), "as.mcap")
    assert found.wrench_t == pytest.approx(wanted.wrench_t, abs=1e-6)
    assert np.array_equal(found.wrench, wanted.wrench)
    assert any("/mavros/rc/out began again after 71.6 minutes" in one for one in found.assumptions)
    assert not any("began again" in one for one in wanted.assumptions)


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


EACH: dict[str, Callable[[float, float], object]] = {
    "my_msgs/msg/Stamped": lambda t, force: {"header": header_of(START_S + t, ""), "data": force},
    "std_msgs/msg/Float64": lambda _, force: {"data": force},
    THRUST[0]: lambda t, force: wrench_message(THRUST[0], START_S + t, 0, force, "rov/thruster"),
}
"""Messages of one thruster's force, as simulators have them, by type."""


def topics_of_each(path: Path, kind: str, force: Callable[[float, int], float]) -> Path:
    """Velocities, and a topic for each of eight thrusters, numbered from 3 as those of no output are."""
    velocities, (t_w, _) = flown(end_s=10.0)
    each = [
        (kind, f"/rov/thrusters/{channel + 3}/thrust", [(t, EACH[kind](t, force(t, channel))) for t in t_w.tolist()])
        for channel in range(8)
    ]
    return bag_of(path, [reported(velocity_message, ODOMETRY, velocities), *each[::-1]])


@pytest.mark.parametrize("kind", EACH)
def test_a_topic_for_each_thruster_is_named_with_a_star(tmp_path: Path, kind: str) -> None:
    vehicle = load_vehicle(default_vehicle())
    bag = topics_of_each(tmp_path / "a.mcap", kind, lambda t, channel: (channel + 1.0) * (1.0 if t < 5.0 else -2.0))
    (found,) = read_bag(bag, TopicSelection(wrench="/rov/thrusters/*/thrust=N"), topics_of(bag), vehicle)
    wanted = [one.channel + 1.0 for one in vehicle.thrusters]
    assert found.forces[0] == pytest.approx(wanted)
    assert found.forces[-1] == pytest.approx([-2.0 * one for one in wanted])
    # All thrusters of a time are one row, as in an array.
    assert (np.diff(found.wrench_t) > 0.0).all()


@pytest.mark.parametrize(
    ("kind", "words", "wanted"),
    [
        ("std_msgs/msg/Float64", [], "is named as --wrench '/rov/thrusters/*/thrust=N' (N, us or ratio)"),
        ("geometry_msgs/msg/WrenchStamped", [], "is named as --wrench '/rov/thrusters/*/thrust=N'"),
        ("std_msgs/msg/Float64", ["--wrench", "/rov/thrusters/*/thrust"], "name their unit: --wrench"),
        ("std_msgs/msg/Float64", ["--wrench", "/rov/thrusters/4/thrust:data=N"], "is float, wanted an array of"),
        ("std_msgs/msg/Float64", ["--wrench", "/auv/*/thrust=N"], "found no such topic"),
        ("std_msgs/msg/Float64", ["--wrench", "/*=N"], "has no 'data' at 'data'"),
    ],
)
def test_topics_of_each_thruster_that_are_named_wrong_are_refused_with_the_name(
    desk: Desk, kind: str, words: list[str], wanted: str
) -> None:
    bag = topics_of_each(desk.folder / "a.mcap", kind, lambda _, channel: 1.0 + channel)
    assert wanted in desk.refused(bag, "--vehicle", default_vehicle(), *words)


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


def test_rates_in_the_axes_of_the_world_are_found_out(tmp_path: Path) -> None:
    """Gazebo's odometry of a link that heads west: a roll to starboard is a negative rate about x of the world."""
    t, rolls = np.arange(0.0, 20.0, 0.05), 0.3 * np.sin(np.arange(0.0, 20.0, 0.05))
    kind, name, rows = reported(velocity_message, ODOMETRY, (array(t), array(-0.3 * np.cos(t))), axis=3)
    for (_, message), at, roll in zip(rows, t.tolist(), rolls.tolist(), strict=True):
        w, x, y, z = math.cos(roll / 2.0), math.sin(roll / 2.0), 0.0, 0.0  # then half a turn: (0, 0, 1) before it
        turned = dict(zip("xyzw", (-y, x, w, -z), strict=True))
        message["pose"]["pose"] = {"position": {"x": -0.2 * at, "y": 0.0, "z": 0.0}, "orientation": turned}
        message["twist"]["twist"]["linear"]["x"] = -0.2
    pushes = reported(wrench_message, THRUST, (array(t), array(np.sin(t))), 3)
    bag = bag_of(tmp_path / "a.mcap", [(kind, name, rows), pushes])
    (found,) = read_bag(bag, TopicSelection(), topics_of(bag))
    assert found.velocity[:, 0] == pytest.approx(0.2)
    assert found.velocity[:, 3] == pytest.approx(0.3 * np.cos(t))
    assert any("its rates as well" in one for one in found.assumptions)
