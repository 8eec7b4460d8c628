"""Body axes of a CSV file whose header does not name them: depth and angles say how velocities are counted."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hindrax_analysis.records.csv.record import read_records
from hindrax_analysis.records.recording import Recording
from hindrax_ident.arrays import Array, array

T = np.arange(0.0, 40.0, 0.1)
SINKS = 0.2 * np.sin(T / 3.0)
DEPTH = 2.0 + 0.6 * (1.0 - np.cos(T / 3.0))
PUSH = 8.0 * np.sin(T / 3.0)


def read(columns: dict[str, Array], frame: str = "") -> Recording:
    rows = zip(T, *columns.values(), strict=True)
    lines = [",".join(f"{cell:.6f}" for cell in row) for row in rows]
    (one,) = read_records("\n".join([f"t,{','.join(columns)}", *lines]), "x.csv", frame)
    return one


def axes_of(record: Recording) -> str:
    (sentence,) = (one for one in record.assumptions if one.startswith("axes are"))
    return sentence


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_what_sinks_has_a_velocity_down(sense: float) -> None:
    """Taken for SNAME, a record with z up gave a net buoyancy of the wrong sign, without a word."""
    found = read({"w": sense * SINKS, "Z": sense * PUSH, "depth": DEPTH})
    assert found.velocity[:, 2] == pytest.approx(SINKS, abs=1e-5)
    assert found.wrench[:, 2] == pytest.approx(PUSH, abs=1e-5)
    wanted = {1.0: "SNAME: x forward, y starboard, z down", -1.0: "x forward, y left, z up"}
    assert axes_of(found) == f"axes are {wanted[sense]}, by depth and w"


def test_a_depth_below_zero_is_a_height() -> None:
    found = read({"w": SINKS, "Z": PUSH, "depth": -DEPTH})
    assert found.velocity[:, 2] == pytest.approx(SINKS, abs=1e-5)
    assert found.attitude[:, 2] == pytest.approx(DEPTH, abs=1e-5)
    assert "depths are heights above the surface, by their sign" in found.assumptions


def test_a_depth_on_both_sides_of_zero_counts_from_where_the_record_began() -> None:
    """Taken for a height above the surface, it turned all axes: net buoyancy and heave were those of the other way."""
    found = read({"w": SINKS, "Z": PUSH, "depth": DEPTH - 2.95})
    assert found.velocity[:, 2] == pytest.approx(SINKS, abs=1e-5)
    assert found.attitude[:, 2] == pytest.approx(DEPTH - 2.95, abs=1e-5)


def test_at_the_surface_a_sensor_may_read_a_little_less_than_zero() -> None:
    found = read({"Z": PUSH, "depth": DEPTH - 2.05})
    assert found.attitude[:, 2] == pytest.approx(DEPTH - 2.05, abs=1e-5)


def test_noise_does_not_tell_and_a_named_frame_stays() -> None:
    noise = np.random.default_rng(1).normal(0.0, 0.01, (2, len(T)))
    found = read({"w": noise[0], "Z": PUSH, "depth": 1.0 + noise[1]})
    assert axes_of(found) == "axes are SNAME: x forward, y starboard, z down"
    named = read({"w": -SINKS, "Z": -PUSH, "depth": DEPTH}, "fsd")
    assert named.velocity[:, 2] == pytest.approx(-SINKS, abs=1e-5)
    assert axes_of(named) == "axes are SNAME: x forward, y starboard, z down, as named, but depth and w say flu"


def test_trials_below_each_other_tell_as_one_does() -> None:
    trials = [zip(T, -SINKS, -PUSH * more, DEPTH, strict=True) for more in (1.0, 1.1)]
    lines = [",".join(f"{cell:.6f}" for cell in row) for rows in trials for row in rows]
    both = read_records("\n".join(["t,w,Z,depth", *lines]), "x.csv")
    assert len(both) == 2
    for one in both:
        assert one.velocity[:, 2] == pytest.approx(SINKS, abs=1e-5)


def test_angles_count_as_their_rates_do() -> None:
    pitch, rate = 0.3 * np.sin(T / 2.0), 0.15 * np.cos(T / 2.0)
    found = read({"pitch": -pitch, "q": rate, "M": PUSH})
    assert found.attitude[:, 1] == pytest.approx(pitch, abs=1e-5)
    assert "pitch is counted against q, and was turned" in found.assumptions
    assert read({"pitch": pitch, "q": rate, "M": PUSH}).attitude[:, 1] == pytest.approx(pitch, abs=1e-5)


@pytest.mark.parametrize(
    ("header", "turned"),
    [
        ("t,/odom/twist/twist/linear/z,/thrust/wrench/force/z", True),
        ("t,field.twist.linear.z,field.wrench.force.z", True),
        ("t,/odom_ned/twist/twist/linear/z,/thrust_ned/wrench/force/z", False),
        ("t,/odom/twist/twist/linear/z,Z", False),
        ("t,w,Z", False),
    ],
)
def test_fields_of_ros_messages_are_in_its_axes_as_in_a_bag(header: str, turned: bool) -> None:
    """Down and up were swapped in a table of what a bag had right."""
    (found,) = read_records(f"{header}\n" + "\n".join(f"{0.1 * i},0.2,7.0" for i in range(30)), "x.csv")
    sign = -1.0 if turned else 1.0
    assert found.velocity[0, 2] == pytest.approx(0.2 * sign)
    assert found.wrench[0, 2] == pytest.approx(7.0 * sign)
    assert any("REP-103" in one for one in found.assumptions) == turned


LEVEL, YAW, ROLL, PITCH = map(array, (0.0 * T, 3.0 + 0.2 * T, 0.3 * np.sin(T), 0.4 * np.cos(0.7 * T)))
FORWARD, ASIDE = array(0.5 * np.sin(0.5 * T)), array(0.2 * np.cos(0.4 * T))


def of_world(*body: Array, angles: tuple[Array, Array, Array]) -> dict[str, Array]:
    """Velocities north, east, down of those of the body (Fossen 2011 eq. 2.18, written out)."""
    (u, v, w), (phi, theta, psi) = body, angles
    c, s = np.cos, np.sin
    # One rotation after the other: about x, then y, then z.
    v, w = c(phi) * v - s(phi) * w, s(phi) * v + c(phi) * w
    u, w = c(theta) * u + s(theta) * w, -s(theta) * u + c(theta) * w
    return {"VN": c(psi) * u - s(psi) * v, "velocity_east": s(psi) * u + c(psi) * v, "vel_d": w}


@pytest.mark.parametrize("frame", ["", "flu"])
def test_velocities_of_the_world_are_turned_into_those_of_the_body(frame: str) -> None:
    moved = of_world(FORWARD, ASIDE, SINKS, angles=(ROLL, PITCH, YAW))
    angles = {"roll_rad": ROLL, "pitch_rad": PITCH, "heading_rad": array((YAW + np.pi) % (2.0 * np.pi) - np.pi)}
    found = read({**moved, **angles, "X": PUSH, "Z": PUSH}, frame)
    assert found.velocity[:, :3] == pytest.approx(np.column_stack([FORWARD, ASIDE, SINKS]), abs=1e-5)
    assert found.wrench[:, 2] == pytest.approx(-PUSH if frame else PUSH, abs=1e-5)
    assert "u, v, w are velocities north and east, turned by roll, pitch and yaw" in found.assumptions


def test_without_roll_and_pitch_the_vehicle_is_level_and_heave_is_unknown() -> None:
    moved = of_world(FORWARD, ASIDE, SINKS, angles=(LEVEL, LEVEL, YAW))
    found = read({**moved, "yaw_rad": YAW, "X": PUSH})
    assert found.velocity[:, :2] == pytest.approx(np.column_stack([FORWARD, ASIDE]), abs=1e-5)
    assert not np.isfinite(found.velocity[:, 2]).any()
    assert "u, v are velocities north and east, turned by yaw, as of a level vehicle" in found.assumptions


def test_a_velocity_of_the_body_in_the_file_stays() -> None:
    moved = of_world(FORWARD, ASIDE, SINKS, angles=(LEVEL, LEVEL, YAW))
    found = read({**moved, "yaw_rad": YAW, "u": array(0.5 * FORWARD), "X": PUSH})
    assert found.velocity[:, 0] == pytest.approx(0.5 * FORWARD, abs=1e-5)
    assert found.velocity[:, 1] == pytest.approx(ASIDE, abs=1e-5)


def test_angles_may_stand_in_other_rows_than_velocities() -> None:
    moved = of_world(FORWARD, ASIDE, SINKS, angles=(LEVEL, LEVEL, YAW))
    rows = [
        f"{t:.3f},{n:.6f},{e:.6f},,{x:.6f}"
        for t, n, e, x in zip(T, moved["VN"], moved["velocity_east"], PUSH, strict=True)
    ]
    rows += [f"{t + 0.05:.3f},,,{psi:.6f}," for t, psi in zip(T, YAW + 0.2 * 0.05, strict=True)]
    (found,) = read_records("\n".join(["t,vn,ve,yaw_rad,X", *rows]), "x.csv")
    assert found.velocity[1:, 0] == pytest.approx(FORWARD[1:], abs=1e-4)


PSI, THETA, PHI = 0.8 * np.sin(T / 7.0) + 2.9, 0.3 * np.sin(T / 2.0), 0.2 * np.sin(T / 3.0)
TURNED = Rotation.from_euler("ZYX", np.column_stack([PSI, THETA, PHI]))
PARTS = ("x", "y", "z", "w")
ROLLS = {"p": np.gradient(PHI, T), "K": PUSH}


def quaternion(names: str, turned: Array | None = None) -> dict[str, Array]:
    """Four columns; `names` with one place for the part."""
    values = TURNED.as_quat() if turned is None else turned
    return {names.format(part): array(values[:, n]) for n, part in enumerate(PARTS)}


@pytest.mark.parametrize("names", ["q{}", "quat_{}", "Quaternion {}", "pose.pose.orientation.{}", "imu_orientation_{}"])
def test_angles_are_those_of_a_quaternion(names: str) -> None:
    found = read(ROLLS | quaternion(names))
    assert found.attitude[:, :2] == pytest.approx(np.column_stack([PHI, THETA]), abs=1e-5)
    assert "roll, pitch, yaw are those of the quaternion" in found.assumptions


def test_a_quaternion_of_px4_has_its_real_part_first() -> None:
    x, y, z, w = TURNED.as_quat().T
    numbers = {f"vehicle_attitude.q[{n}]": array(part) for n, part in enumerate((w, x, y, z))}
    assert read(ROLLS | numbers).attitude[:, :2] == pytest.approx(np.column_stack([PHI, THETA]), abs=1e-5)


def test_a_quaternion_of_ros_turns_with_its_velocities() -> None:
    names = {"twist.angular.x": ROLLS["p"], "wrench.torque.x": PUSH, "twist.linear.y": SINKS, "wrench.force.y": PUSH}
    found = read(names | quaternion("pose.orientation.{}"))
    assert axes_of(found).startswith("axes are x forward, y left, z up")
    assert found.velocity[:, 1] == pytest.approx(-SINKS, abs=1e-5)
    assert found.attitude[:, :2] == pytest.approx(np.column_stack([PHI, -THETA]), abs=1e-5)


def test_named_angles_are_used_first() -> None:
    found = read(ROLLS | {"roll": 0.5 * PHI} | quaternion("q{}"))
    assert found.attitude[:, 0] == pytest.approx(0.5 * PHI, abs=1e-5)


def test_positions_are_turned_by_a_quaternion_as_by_a_yaw() -> None:
    level = Rotation.from_euler("Z", PSI[:, np.newaxis]).as_quat()
    ways = {"px": 0.1 * T, "py": 0.5 * np.sin(T / 4.0), "X": PUSH, "Y": PUSH}
    by_yaw, found = read(ways | {"yaw": PSI}), read(ways | quaternion("q{}", level))
    assert found.velocity[:, :2] == pytest.approx(by_yaw.velocity[:, :2], abs=1e-3)
    assert len(found.velocity)


MOVES = array(np.column_stack([0.3 * np.sin(T / 2.0), 0.1 * np.cos(T / 3.0), SINKS]))
TURNS = array(np.column_stack([0.1 * np.sin(T / 2.0), 0.1 * np.cos(T / 3.0), 0.2 * np.sin(T / 4.0) - 0.1]))


def simulated(*, of_world: bool, down: bool) -> dict[str, Array]:
    """Pose, velocities and rates of one world, as a simulator writes them; z down or up; in axes of world or body."""
    attitudes = [Rotation.from_euler("ZYX", [2.2, 0.0, 0.0])]
    for turn in TURNS[:-1]:
        attitudes.append(attitudes[-1] * Rotation.from_rotvec(0.1 * turn))
    attitude = Rotation.concatenate(attitudes)
    places = np.cumsum(np.concatenate([np.zeros((1, 3)), 0.1 * attitude.apply(MOVES)[:-1]]), axis=0)
    v, rates = (attitude.apply(one) if of_world else one for one in (MOVES, TURNS))
    if down:  # the same motion in NED and FRD
        half = Rotation.from_euler("X", np.pi)
        places, v, rates, attitude = (*(one * [1.0, -1.0, -1.0] for one in (places, v, rates)), half * attitude * half)
    names = {f"position_{axis}": places[:, n] for n, axis in enumerate("xy")}
    names |= {f"linear_velocity_{axis}": v[:, n] for n, axis in enumerate("xyz")}
    names |= {f"angular_velocity_{axis}": rates[:, n] for n, axis in enumerate("xyz")}
    return {name: array(one) for name, one in names.items()} | quaternion("orient_{}", attitude.as_quat()) | {"X": PUSH}


@pytest.mark.parametrize("words", ["", "position_"])
@pytest.mark.parametrize("down", [False, True])
@pytest.mark.parametrize("of_world", [False, True])
def test_velocities_of_the_world_under_names_of_the_body_are_found_out(of_world: bool, down: bool, words: str) -> None:
    """Of a simulated BlueROV2 that turned as it went, all axes were refused: 'check the direction of each thruster'."""
    table = simulated(of_world=of_world, down=down)
    found = read({name.removeprefix(words): one for name, one in table.items()})
    signs = [1.0, -1.0, -1.0] if down else [1.0, 1.0, 1.0]
    assert found.velocity == pytest.approx(np.column_stack([MOVES * signs, TURNS * signs]), abs=1e-4)
    said = [one for one in found.assumptions if "in the axes of the world" in one]
    assert len(said) == 2 * of_world


def test_a_pose_in_other_rows_tells_as_well() -> None:
    table = simulated(of_world=True, down=False)
    posed = [name for name in table if name.startswith(("position", "orient"))]
    lines = [f"timestamps,{','.join(table)}"]
    for late, named in ((0.0, True), (0.02, False)):
        for n, t in enumerate(T):
            cells = [f"{table[name][n]:.7f}" if (name in posed) == named else "" for name in table]
            lines.append(f"{t + late:.3f},{','.join(cells)}")
    (found,) = read_records(
        "\n".join([lines[0], *sorted(lines[1:], key=lambda one: float(one.split(",")[0]))]), "x.csv"
    )
    assert found.velocity[2:, :3] == pytest.approx(MOVES[2:], abs=0.01)


@pytest.mark.parametrize("turned", [np.zeros((len(T), 4)), np.tile([0.0, 0.0, 0.0, 1.0], (len(T), 1))])
def test_a_quaternion_that_was_never_filled_in_says_nothing(turned: Array) -> None:
    found = read(ROLLS | quaternion("q{}", turned))
    assert not np.isfinite(found.attitude).any()
    assert not any("quaternion" in one for one in found.assumptions)


def test_of_two_quaternions_none_is_used() -> None:
    found = read(ROLLS | quaternion("rov_orientation_{}") | quaternion("camera_orientation_{}"))
    assert not np.isfinite(found.attitude).any()


@pytest.mark.parametrize(("angle", "moment", "axis"), [("roll", "K", 3), ("pitch", "M", 4), ("heading", "N", 5)])
def test_the_rate_of_an_angle_beside_its_moment_follows_from_it(angle: str, moment: str, axis: int) -> None:
    """A compass and a moment were refused: "wanted at least one pair of velocity and force"."""
    turned = 0.4 * np.sin(T / 3.0) + (3.0 if angle == "heading" else 0.0)
    noisy = turned + np.random.default_rng(2).normal(0.0, 1e-4, len(T))
    found = read({f"{angle}_deg": array(np.degrees(noisy)), moment: PUSH})
    rates = found.velocity[:, axis]
    known = np.isfinite(rates)
    assert known.sum() > 0.9 * len(T)
    assert rates[known] == pytest.approx(0.4 / 3.0 * np.cos(found.velocity_t[known] / 3.0), abs=0.01)
    assert np.isnan(np.delete(found.velocity, axis, axis=1)).all()
    assert f"{'pqr'[axis - 3]} follows from {'yaw' if axis == 5 else angle}" in found.assumptions


def test_a_rate_in_the_file_stays_and_none_is_made_without_its_moment() -> None:
    rates = array(0.1 * np.cos(T / 3.0))
    assert read({"yaw": PSI, "r": rates, "N": PUSH}).velocity[:, 5] == pytest.approx(rates, abs=1e-6)
    assert np.isnan(read({"yaw": PSI, "u": SINKS, "X": PUSH}).velocity[:, 5]).all()


def test_velocities_of_the_world_without_a_heading_are_not_dropped_in_silence() -> None:
    found = read({"vn": SINKS, "ve": SINKS, "r": SINKS, "X": PUSH, "Y": PUSH, "N": PUSH})
    assert any("a column yaw" in one for one in found.assumptions)
    assert not any("a column yaw" in one for one in read({"vn": SINKS, "ve": SINKS, "u": SINKS, "X": PUSH}).assumptions)
