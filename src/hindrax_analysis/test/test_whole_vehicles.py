"""Whole vehicles for gz-sim, Stonefish and ros2_control are that of the file: thrusts, lags, places, names."""

from collections.abc import Mapping
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import yaml

from hindrax_analysis.exports import gz, stonefish, stonefish_vehicle, urdf
from hindrax_analysis.exports.export_model import ExportModel, thrust_range_N, unidentified_model
from hindrax_bringup.share_files import vehicle_file
from hindrax_control.allocation.effectiveness import effectiveness
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.arrays import Array


@pytest.fixture(scope="module", params=["hindrax", "bluerov2", "bluerov2-heavy", "lbv"])
def model(request: pytest.FixtureRequest) -> ExportModel:
    return unidentified_model(load_vehicle(vehicle_file(request.param)), request.param)


@pytest.fixture(scope="module")
def files(model: ExportModel) -> Mapping[str, str]:
    return stonefish_vehicle.folder(model)


@pytest.fixture(scope="module")
def robot(files: Mapping[str, str]) -> ET.Element:
    found = ET.fromstring(files["vehicle.scn"]).find("robot")
    assert found is not None
    return found


def floats(text: str | None) -> list[float]:
    return [float(word) for word in (text or "").split()]


def origin(element: ET.Element) -> tuple[list[float], list[float]]:
    found = element.find("origin")
    assert found is not None
    return floats(found.get("xyz")), floats(found.get("rpy"))


def pushed(rpy: list[float]) -> Array:
    """Where the x axis of an actuator points: yaw about z, then pitch about y, in axes x forward, y right, z down."""
    _, pitch, yaw = rpy
    return np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), -np.sin(pitch)])


def test_newtons_of_the_thrusters_make_the_wrench_of_the_allocation(model: ExportModel, robot: ET.Element) -> None:
    columns = []
    for actuator in robot.findall("actuator"):
        place, rpy = origin(actuator)
        arm = np.array(place) - np.array(model.vehicle.center_of_mass_m)
        columns.append(np.concatenate((pushed(rpy), np.cross(arm, pushed(rpy)))))
    assert np.transpose(columns) == pytest.approx(np.array(effectiveness(model.vehicle)), abs=1e-6)


def test_each_thruster_has_its_range_and_lag(model: ExportModel, robot: ET.Element) -> None:
    actuators = robot.findall("actuator")
    assert [one.get("name") for one in actuators] == [one.name for one in model.vehicle.thrusters]
    for thruster, actuator in zip(model.vehicle.thrusters, actuators, strict=True):
        low, high = thrust_range_N(model.vehicle, thruster)
        curve, rotor, specs = (actuator.find(tag) for tag in ("thrust_model", "rotor_dynamics/time_constant", "specs"))
        assert curve is not None
        assert rotor is not None
        assert specs is not None
        for tag in ("input", "output"):
            (points,) = curve.findall(tag)
            assert floats(points.get("value")) == pytest.approx([low, high], rel=1e-6)
        assert float(rotor.get("value", "")) == thruster.lag_s
        assert float(specs.get("max_setpoint", "")) == pytest.approx(max(-low, high), rel=1e-6)


def test_the_body_is_that_of_the_dynamic_element(model: ExportModel, robot: ET.Element) -> None:
    base, alone = robot.find("base_link"), ET.fromstring(stonefish.write(model))
    assert base is not None
    own = [ET.tostring(part).split() for part in base]
    assert own == [ET.tostring(part).split() for part in alone if part.tag != "world_transform"]


def test_sensors_stand_at_their_places_and_odometry_is_of_the_center_of_mass(
    model: ExportModel, robot: ET.Element
) -> None:
    places = {one.get("name"): origin(one)[0] for one in robot.findall("sensor")}
    assert places.pop("odometry") == pytest.approx(model.vehicle.center_of_mass_m)
    for name, place in places.items():
        mount = next(mount for own, mount in model.vehicle.sensors.items() if str(name).startswith(own))
        assert place == pytest.approx(mount.position_m)
    kinds = {one.get("type") for one in robot.findall("sensor")}
    assert ("dvl" in kinds) == bool(model.vehicle.measuring("velocity"))


def test_what_a_file_names_is_there(files: Mapping[str, str], robot: ET.Element) -> None:
    world = ET.fromstring(files["world.scn"])
    assert [one.get("file") for one in world.findall("include")] == ["vehicle.scn"]
    assert {one.get("filename") for one in robot.iter("mesh")} <= set(files)
    for kind, known in (("material", "materials/material"), ("look", "looks/look")):
        used = {one.get("name") for root in (robot, world) for one in root.iter(kind)}
        assert used == {one.get("name") for one in world.findall(known)} & used
        assert used <= {one.get("name") for one in world.findall(known)}


def test_sensors_of_gazebo_stand_at_their_places_and_the_world_serves_them(model: ExportModel) -> None:
    files = gz.folder(model)
    link = ET.fromstring(files["model.sdf"]).find("model/link")
    assert link is not None
    served = {str(one.get("filename")) for one in ET.fromstring(files["world.sdf"]).iter("plugin")}
    bridged = {row["gz_topic_name"] for row in yaml.safe_load(files["bridge.yaml"])}
    found = link.findall("sensor")
    assert {one.get("type") for one in found} == {"imu", "altimeter"}
    for sensor in found:
        kind = str(sensor.get("type"))
        mount = model.vehicle.sensors[str(sensor.get("name")).removesuffix(f"_{kind}")]
        x, y, z = np.subtract(mount.position_m, model.vehicle.center_of_mass_m)
        assert floats(sensor.findtext("pose"))[:3] == pytest.approx([x, -y, -z])
        assert f"gz-sim-{kind}-system" in served
        assert kind != "imu" or sensor.findtext("topic") in bridged


def test_effort_joints_of_ros2_control_are_joints_of_the_robot_that_turn(model: ExportModel) -> None:
    robot = ET.fromstring(urdf.write(model.vehicle))
    joints = {one.get("name"): one for one in robot.findall("joint")}
    controlled = robot.findall("ros2_control/joint")
    assert [one.get("name") for one in controlled] == [f"{one.name}_link_joint" for one in model.vehicle.thrusters]
    for joint, thruster in zip(controlled, model.vehicle.thrusters, strict=True):
        turning = joints[joint.get("name")]
        assert turning.get("type") == "continuous"
        assert turning.find("axis") is not None
        limits = {one.get("name"): float(one.text or "") for one in joint.findall("command_interface/param")}
        low, high = thrust_range_N(model.vehicle, thruster)
        assert (limits["min"], limits["max"]) == pytest.approx((low, high), rel=1e-6)
