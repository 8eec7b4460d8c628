"""A parameter that no node has, and a value that its node would not take, are refused before anything starts."""

from pathlib import Path

import pytest

from hindrax_bringup.node_options import ParameterOverrides
from hindrax_bringup.share_files import default_vehicle
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_operator.node_parameters import check_parameters


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return load_vehicle(default_vehicle())


def check(vehicle: Vehicle, *settings: str, file: str = "") -> None:
    check_parameters(ParameterOverrides(file=file, settings=settings, sensors=tuple(vehicle.sensors)), vehicle)


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("pilot.nonsense:=2", "parameter pilot.nonsense: pilot has no such parameter; wanted one of"),
        ("pilot.plan.level:=2", "parameter pilot.plan.level: pilot has no such parameter; the nearest is plan.levels"),
        ("pilot.safety.surface_m:=40.0", "the nearest is guards.surface_m"),
        ("pilot.plan.levels:=banana", "pilot.plan.levels: found 'banana', wanted a whole number"),
        ("pilot.plan.levels:=99", "pilot.plan.levels: found 99, wanted 1 to 20"),
        ("pilot.bag:=run", "pilot has no such parameter"),
        ("ms5837.oversampling:=3", "ms5837.oversampling: found 3"),
    ],
)
def test_a_single_parameter_that_is_wrong_is_refused(vehicle: Vehicle, setting: str, said: str) -> None:
    with pytest.raises(UsageError) as refused:
        check(vehicle, setting)
    assert said in str(refused.value)


@pytest.mark.parametrize("setting", ["pilot.plan.levels:=2", "pilot.plan.surge_mps:=[0.1, 0.3]", "dvl75.port:=x"])
def test_what_a_node_declares_is_taken(vehicle: Vehicle, setting: str) -> None:
    check(vehicle, setting)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("/**/pilot: {ros__parameters: {plan.level: 2}}", "the nearest is plan.levels"),
        ("/hindrax/pilot: {ros__parameters: {plan: {levels: 0}}}", "pilot.plan.levels: found 0, wanted 1 to 20"),
        ("/**: {ros__parameters: {vehicel: 2}}", "vehicel"),
    ],
)
def test_a_file_that_is_wrong_is_refused(vehicle: Vehicle, tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(text)
    with pytest.raises(UsageError) as refused:
        check(vehicle, file=str(file))
    assert said in str(refused.value)


def test_a_file_as_ros_writes_it_and_of_other_nodes_is_taken(vehicle: Vehicle, tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(
        "/**: {ros__parameters: {use_sim_time: true, plan.levels: 2}}\n"
        "/hindrax/recorder: {ros__parameters: {notes: pool, qos_overrides./tf.publisher.depth: 1}}\n"
        "/other/robot: {ros__parameters: {whatever: 3}}\n"
    )
    check(vehicle, file=str(file))
