"""Columns of single thrusters in CSV files: which they are, and the forces that follow from them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from hindrax_analysis.records.csv.record import read_records
from hindrax_analysis.records.csv.thrusters import is_supply, output_of
from hindrax_analysis.records.recording import Recording, joined
from hindrax_bringup.share_files import default_vehicle
from hindrax_control.allocation.thrust_curve import AppliedWrench
from hindrax_core.errors import HindraxError
from hindrax_core.signals import Supply
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ident.arrays import Array, array

PULSES = (1600.0, 1580.0, 1400.0, 1420.0, 1530.0, 1470.0, 1550.0, 1500.0)


@pytest.fixture(scope="module")
def heavy() -> Vehicle:
    return load_vehicle(default_vehicle().parent / "bluerov2-heavy.yaml")


def read(names: Sequence[str], rows: Sequence[Sequence[object]], vehicle: Vehicle | None, frame: str = "") -> Recording:
    lines = [",".join(map(str, row)) for row in ([*names], *rows)]
    (one,) = read_records("\n".join(lines), "dive.csv", frame, vehicle=vehicle)
    return one


def wrench(vehicle: Vehicle, pulses: Sequence[float], supply_V: float | None = None) -> Array:
    applied = AppliedWrench(vehicle, supply_V or vehicle.supply_V)
    by_thruster = [pulses[one.channel] for one in vehicle.thrusters]
    return array(applied.wrench(applied.forces_N(by_thruster)))


@pytest.mark.parametrize(
    ("header", "number", "unit", "factor"),
    [
        ("pwm1", 1, "", 1.0),
        ("PWM_8 [us]", 8, "us", 1.0),
        ("servo3_raw", 3, "", 1.0),
        ("C12", 12, "", 1.0),
        ("/mavros/rc/out/channels[0]", 0, "", 1.0),
        ("RCOU.C4", 4, "", 1.0),
        ("thruster_2_N", 2, "N", 1.0),
        ("thruster_2_force_N", 2, "N", 1.0),
        ("T3", 3, "", 1.0),
        ("cmd_4 [N]", 4, "N", 1.0),
        ("thruster5_rpm", 5, "rpm", 1.0),
        ("thruster3_thrust [kgf]", 3, "N", 9.80665),
        ("SERVO_OUTPUT_RAW.servo4_raw", 4, "", 1.0),
        ("thrust 5 (kgf)", 5, "N", 9.80665),
        ("throttle_1", 1, "ratio", 1.0),
        ("Motor 7 [%]", 7, "ratio", 0.01),
    ],
)
def test_outputs_are_known_by_a_word_and_a_number(header: str, number: int, unit: str, factor: float) -> None:
    assert output_of(header) == (number, unit, factor)


@pytest.mark.parametrize(
    "header", ["t", "u", "X", "r1", "imu1", "temperature_1", "pwm", "thruster_x", "force_1_furlong"]
)
def test_other_columns_are_no_outputs(header: str) -> None:
    assert output_of(header) is None


@pytest.mark.parametrize(
    "header", ["supply_V", "battery_voltage", "Voltage [V]", "vbat", "/mavros/battery/voltage", "BAT.Volt"]
)
def test_a_supply_is_known(header: str) -> None:
    assert is_supply(header)
    assert not is_supply("velocity")


def test_what_is_called_a_thrust_and_is_a_share_or_a_pulse_is_no_force(heavy: Vehicle) -> None:
    """Shares of full throttle in columns thrust0 ... became newtons: fifty times too little thrust, without a word."""
    names = ["t", "u", *(f"thrust{n}" for n in range(8))]
    forces = read(names, [(0.0, 0.1, *([5.0] * 8)), (1.0, 0.2, *([-0.5] * 8))], heavy).wrench
    assert forces[1] == pytest.approx(-0.1 * forces[0])
    pulses = read(names, [(0.0, 0.1, *PULSES), (1.0, 0.2, *([1500.0] * 8))], heavy).wrench
    assert pulses[0] == pytest.approx(wrench(heavy, PULSES))
    with pytest.raises(HindraxError, match=r"holds -0.5 to 0.9, no pulses .* thruster1_N .* thruster1_ratio"):
        read(names, [(0.0, 0.1, *([0.9] * 8)), (1.0, 0.2, *([-0.5] * 8))], heavy)


def test_speeds_of_rotation_are_refused_with_the_law_of_the_thrust(heavy: Vehicle) -> None:
    with pytest.raises(HindraxError, match=r"rpm, wanted forces or pulses; write thruster1_N = k n \|n\|"):
        read(["t", "u", *(f"rpm_{n + 1}" for n in range(8))], [(0.0, 0.1, *([900.0] * 8))], heavy)


@pytest.mark.parametrize("first", [0, 1])
def test_pulses_become_the_forces_of_the_vehicle_file(heavy: Vehicle, first: int) -> None:
    names = ["t", "u", *(f"pwm{first + n}" for n in range(8))]
    found = read(names, [(0.0, 0.1, *PULSES), (1.0, 0.2, *([1500.0] * 8))], heavy)
    assert found.wrench == pytest.approx(np.array([wrench(heavy, PULSES), np.zeros(6)]))
    assert any("supply of the vehicle file" in one for one in found.assumptions)
    assert found.supply is Supply.ASSUMED


@pytest.mark.parametrize("volts", [(14.0, 12.0), (14.0, "")])
def test_pulses_beside_a_voltage_have_a_measured_supply(heavy: Vehicle, volts: Sequence[object]) -> None:
    names = ["t", "u", *(f"pwm{n}" for n in range(8)), "supply_V"]
    found = read(names, [(float(t), 0.1 + t, *PULSES, one) for t, one in enumerate(volts)], heavy)
    assert found.wrench[0] == pytest.approx(wrench(heavy, PULSES, 14.0))
    bare = replace(found, wrench_t=found.wrench_t[:0], wrench=found.wrench[:0], supply=Supply.ASSUMED)
    assert found.supply is joined(found, bare).supply is joined(bare, found).supply is Supply.MEASURED


def test_forces_beside_a_voltage_were_computed_by_who_knows(heavy: Vehicle) -> None:
    names = ["t", "u", *(f"thruster{n + 1}_N" for n in range(8)), "supply_V"]
    assert read(names, [(0.0, 0.1, *([5.0] * 8), 14.0), (1.0, 0.2, *([5.0] * 8), 14.0)], heavy).supply is Supply.ASSUMED


def test_forces_are_in_the_axes_of_the_vehicle_file_whatever_the_velocities_are(heavy: Vehicle) -> None:
    names = ["t", "v", *(f"pwm{1 + n}" for n in range(8))]
    found = read(names, [(0.0, 0.1, *PULSES), (1.0, 0.2, *PULSES)], heavy, "flu")
    assert found.velocity[:, 1].tolist() == [-0.1, -0.2]
    assert found.wrench[0] == pytest.approx(wrench(heavy, PULSES))


def test_velocities_of_a_ros_message_beside_outputs_are_turned_and_the_forces_are_not(heavy: Vehicle) -> None:
    """An Odometry and an RCOut in one table: sway, heave and yaw moved against their thrust."""
    names = ["t", "/odom/twist/twist/linear/y", *(f"/mavros/rc/out/channels[{n}]" for n in range(8))]
    found = read(names, [(0.0, 0.1, *PULSES), (1.0, 0.2, *PULSES)], heavy)
    assert found.velocity[:, 1].tolist() == [-0.1, -0.2]
    assert found.wrench[0] == pytest.approx(wrench(heavy, PULSES))


def test_a_measured_supply_counts_and_is_carried_between_its_rows(heavy: Vehicle) -> None:
    names = ["t", "u", *(f"servo{1 + n}_raw" for n in range(8)), "battery_voltage"]
    rows = [(0.0, 0.1, *PULSES, 15.0), (1.0, 0.2, *PULSES, ""), (2.0, 0.2, *PULSES, 14.0)]
    found = read(names, rows, heavy)
    for row, volts in zip(found.wrench, (15.0, 14.5, 14.0), strict=True):
        assert row == pytest.approx(wrench(heavy, PULSES, volts))


def test_forces_and_shares_are_taken_by_their_units(heavy: Vehicle) -> None:
    forces = [1.0, -2.0, 3.0, 0.5, 0.0, 1.5, -1.0, 2.0]
    named = ["t", "u", *(f"thruster_{1 + n}_N" for n in range(8))]
    found = read(named, [(0.0, 0.1, *forces), (1.0, 0.1, *forces)], heavy)
    assert found.wrench[0] == pytest.approx(
        AppliedWrench(heavy).wrench([forces[one.channel] for one in heavy.thrusters])
    )
    below = ["t", "u", *(f"thruster_{1 + n}" for n in range(8))]
    units = ["s", "m/s", *(["kgf"] * 8)]
    rows = [units, (0.0, 0.1, *(one / 9.80665 for one in forces)), (1.0, 0.1, *forces)]
    assert read(below, rows, heavy).wrench[0] == pytest.approx(found.wrench[0])
    stopped = read(
        ["t", "u", *(f"throttle{n}" for n in range(8))], [(0.0, 0.1, *([0.0] * 8)), (1, 0.1, *([1.0] * 8))], heavy
    )
    assert stopped.wrench[0].tolist() == [0.0] * 6
    assert np.abs(stopped.wrench[1]).max() > 1.0


def test_forces_of_the_vehicle_in_the_file_come_first(heavy: Vehicle) -> None:
    found = read(["t", "u", "X", "pwm1"], [(0.0, 0.1, 5.0, 1600.0), (1.0, 0.1, 6.0, 1600.0)], heavy)
    assert found.wrench[:, 0].tolist() == [5.0, 6.0]


@pytest.mark.parametrize(
    ("names", "row", "named"),
    [
        (("pwm1", "pwm2"), (1600, 1600), "also needs 3, 4, 5, 6, 7, 8"),
        (tuple(f"thruster_{1 + n}" for n in range(8)), (5.0,) * 8, "name their unit: thruster1_N"),
        ((*(f"pwm{1 + n}" for n in range(8)), "throttle_9"), (1600,) * 9, "all in one unit"),
        (tuple(f"pwm{1 + n}" for n in range(8)), ("much", *(1600,) * 7), "column pwm1: found 'much'"),
        (tuple(f"throttle{1 + n}" for n in range(8)), (1.5,) * 8, "from -1 to 1"),
    ],
)
def test_what_cannot_be_used_is_named(
    heavy: Vehicle, names: tuple[str, ...], row: Sequence[object], named: str
) -> None:
    with pytest.raises(HindraxError, match=r"dive\.csv") as caught:
        read(["t", "u", *names], [(0.0, 0.1, *row), (1.0, 0.1, *row)], heavy)
    assert named in str(caught.value)


def test_without_a_vehicle_pulses_are_no_forces() -> None:
    with pytest.raises(HindraxError, match="--vehicle"):
        read(["t", "u", "pwm1"], [(0.0, 0.1, 1600), (1.0, 0.1, 1600)], None)
