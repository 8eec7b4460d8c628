"""Names that other people's CSV files have for the columns of a record."""

import math

import numpy as np
import pytest

from hindrax_analysis.records.csv.columns import meaning_of, time_of
from hindrax_analysis.records.csv.record import read_records
from hindrax_analysis.records.recording import Recording
from hindrax_core.errors import HindraxError


def read(header: str, *rows: str) -> Recording:
    (one,) = read_records("\n".join([header, *rows]), "x.csv")
    return one


@pytest.mark.parametrize(
    ("header", "name", "factor"),
    [
        ("TimeUS", "t", 1e-6),
        ("time_boot_ms", "t", 1e-3),
        ("Elapsed Time [min]", "t", 60.0),
        ("lin_vel_x", "u", 1.0),
        ("v_body_y", "v", 1.0),
        ("dvl_vz", "w", 1.0),
        ("/dvl/velocity/x", "u", 1.0),
        ("SurgeVel_cm_s", "u", 0.01),
        ("u_m_s", "u", 1.0),
        ("GyrZ", "r", 1.0),
        ("yawspeed", "r", 1.0),
        ("/imu/angular_velocity/y", "q", 1.0),
        ("nu_6", "r", 1.0),
        ("u_meas", "u", 1.0),
        ("r_imu", "r", 1.0),
        ("X_est", "X", 1.0),
        ("ATTITUDE.yawspeed", "r", 1.0),
        ("tau_1", "X", 1.0),
        ("utc_timestamp", "t", 1.0),
        ("F_surge", "X", 1.0),
        ("M_yaw [N m]", "N", 1.0),
        ("x", "px", 1.0),
        ("odom.y", "py", 1.0),
    ],
)
def test_loose_names_are_known(header: str, name: str, factor: float) -> None:
    found = meaning_of(header)
    assert found is not None
    assert found.gives_way
    assert found.name == name
    assert found.factor == pytest.approx(factor)


@pytest.mark.parametrize(
    "header",
    [
        "u_std",
        "cmd_vx",
        "setpoint_u",
        "surge_ref",
        "vx_cov",
        "target_velocity_x",
        "mx",
        "m_z",
        "ekf_vx [counts]",
        "psi_dot",
    ],
)
def test_commands_deviations_and_magnetic_fields_are_not_taken_for_motion(header: str) -> None:
    assert meaning_of(header) is None


def test_a_loose_name_gives_way_to_a_usual_one() -> None:
    found = read("timestamp,TimeUS,u,dvl_vx,X", "0,0,0.1,9,1", "1,1000000,0.2,9,2")
    assert found.velocity[:, 0].tolist() == [0.1, 0.2]
    assert found.velocity_t.tolist() == [0.0, 1.0]


def test_two_loose_names_of_one_meaning_are_refused() -> None:
    with pytest.raises(HindraxError, match="dvl_vx and ekf_vx mean the same"):
        read("t,dvl_vx,ekf_vx,X", "0,0.1,9,1", "1,0.2,9,2")


@pytest.mark.parametrize("first", [0, 1])
def test_vectors_count_from_zero_or_one(first: int) -> None:
    for form in ("{}[{}]", "{}{}", "{}({})"):
        names = [form.format(vector, number + first) for vector in ("nu", "tau") for number in range(6)]
        found = read(",".join(["t", *names]), ",".join(map(str, range(13))), ",".join(map(str, range(1, 14))))
        assert found.velocity[0].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
        assert found.wrench[0].tolist() == [7.0, 8.0, 9.0, 10.0, 11.0, 12.0]


@pytest.mark.parametrize("header", ["t,x,y,yaw,u,X,Y", "t,x,y,odom.x,odom.y,yaw,u,v,X,Y", "t,px,py,x,y,yaw,u,v,X,Y"])
def test_an_x_and_a_y_may_be_anything_and_are_no_way(header: str) -> None:
    """Of a joystick, in pixels, of another estimator: no way along an axis, and no reason to refuse the file."""
    rows = [",".join(f"{0.1 * row * (one + 1)}" for one in range(header.count(",") + 1)) for row in range(30)]
    assert not len(read(header, *rows).way_t)


def test_a_heading_by_another_name_stays_without_a_place() -> None:
    rows = [f"{0.1 * row},{math.sin(0.3 * row)},{math.cos(0.3 * row)}" for row in range(60)]
    assert np.isfinite(read("t,attitude.yaw,N", *rows).velocity[:, 5]).any()


@pytest.mark.parametrize(("header", "name"), [("X [m]", "px"), ("Y (cm)", "py"), ("Z [m]", None), ("X [N]", "X")])
def test_a_capital_is_a_force_unless_its_unit_is_a_length(header: str, name: str | None) -> None:
    found = meaning_of(header)
    assert (found and found.name) == name


def test_a_moment_is_one_by_its_unit() -> None:
    found = meaning_of("Mz [N·m]")
    assert found is not None
    assert (found.name, found.factor) == ("N", 1.0)
    assert meaning_of("Mz [uT]") is None


def test_a_header_line_that_is_a_comment_counts_where_no_other_does() -> None:
    """As numpy writes it."""
    found = read("# made by numpy\n# t u X", "0 0.1 5", "1 0.2 6")
    assert found.velocity[:, 0].tolist() == [0.1, 0.2]
    assert read("# t u X\nt u Y X", "0 0.1 9 5", "1 0.2 9 6").wrench[:, 0].tolist() == [5.0, 6.0]


def test_seconds_and_nanoseconds_are_one_time() -> None:
    found = read("sec,nanosec,u,X", "5,500000000,0.1,1", "6,250000000,0.2,2")
    assert found.velocity_t.tolist() == [0.0, 0.75]


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("0.1 sec", 0.1), ("250 ms", 0.25), ("1:02:03.5", 3723.5), ("02:03", 123.0), ("1970-01-01 00:00:01", 1.0)],
)
def test_times_are_read_as_spreadsheets_and_matlab_write_them(text: str, seconds: float) -> None:
    assert time_of(text) == pytest.approx(seconds)


@pytest.mark.parametrize(
    ("header", "name", "factor"),
    [
        ("t/s", "t", 1.0),
        ("u/(mm/s)", "u", 1e-3),
        ("X/kN", "X", 1e3),
        ("r, deg/s", "r", math.pi / 180.0),
        ("N/(N m)", "N", 1.0),
        ("u [cm/sec]", "u", 0.01),
        ("v (metres per second)", "v", 1.0),
        ("w (m·s⁻¹)", "w", 1.0),
        ("r (degrees/second)", "r", math.pi / 180.0),
        ("X (Newtons)", "X", 1.0),
        ("N (Newton meter)", "N", 1.0),
        ("Time (milliseconds)", "t", 1e-3),
    ],
)
def test_units_are_known_behind_a_mark_and_spelled(header: str, name: str, factor: float) -> None:
    found = meaning_of(header)
    assert found is not None
    assert found.has_unit
    assert found.name == name
    assert found.factor == pytest.approx(factor)


@pytest.mark.parametrize("header", ["/odom/u/s", "speed/m", "heave/w"])
def test_a_path_is_no_name_with_a_unit(header: str) -> None:
    found = meaning_of(header)
    assert found is None or not found.has_unit


def test_the_time_in_another_language_is_the_column_with_a_unit_of_time() -> None:
    found = read("Zeit [ms];u [m/s];X [N]", "0;0,1;1", "1000;0,2;2")
    assert found.velocity_t.tolist() == [0.0, 1.0]
    assert found.velocity[:, 0].tolist() == [0.1, 0.2]


def test_a_delay_with_a_unit_is_not_the_time_beside_it() -> None:
    found = read("t,u,X,lag [ms]", "0,0.1,1,7", "1,0.2,2,8")
    assert found.velocity_t.tolist() == [0.0, 1.0]


def test_a_moment_is_one_by_the_unit_below_its_name() -> None:
    found = read("Time,Yaw rate,Mz", "ms,deg/s,N m", "0,1,3", "1000,2,4")
    assert found.wrench[:, 5].tolist() == [3.0, 4.0]
    assert found.velocity_t.tolist() == [0.0, 1.0]


def test_what_is_not_understood_is_named_where_a_force_is_missing() -> None:
    rows = ("0,0.1,1,0.3,7", "1,0.2,2,0.4,8")
    assert "no column is N; not understood: tz" in read("t,u,X,r,tz", *rows).assumptions
    assert not any("not understood" in one for one in read("t,u,X,N,tz", *rows).assumptions)


def test_a_table_on_its_side_is_not_printed_whole() -> None:
    lines = [",".join(["t", *(f"{0.1 * row:.1f}" for row in range(2000))]), ",".join(["u", *["0.5"] * 2000])]
    with pytest.raises(HindraxError, match="and 1977 more; wanted t and") as refused:
        read_records("\n".join(lines), "x.csv")
    assert len(str(refused.value)) < 1000


def test_a_file_without_a_time_is_told_so() -> None:
    with pytest.raises(HindraxError, match="none of them is a time: call it t"):
        read("Zeitstempel,u,X", "0,0.1,1", "1,0.2,2")
