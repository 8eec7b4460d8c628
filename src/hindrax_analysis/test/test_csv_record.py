"""CSV as other people write it: names, units, separators, times; and what is refused."""

import math
import tracemalloc
from typing import Any

import pytest

from hindrax_analysis.records.csv.columns import meaning_of
from hindrax_analysis.records.csv.record import read_records
from hindrax_analysis.records.recording import Recording
from hindrax_core.errors import HindraxError

TIMES, SPEEDS, FORCES = (0.0, 0.1, 0.25), (0.1, 0.2, 0.3), (5.0, -6.0, 7.0)


def read_csv(text: str, source: str, frame: str = "") -> Recording:
    (one,) = read_records(text, source, frame)
    return one


def is_read(text: str, frame: str = "") -> Recording:
    found = read_csv(text, "x.csv", frame)
    assert found.velocity_t.tolist() == pytest.approx(TIMES, abs=1e-6)
    assert found.velocity[:, 0].tolist() == pytest.approx(SPEEDS)
    assert found.wrench[:, 0].tolist() == pytest.approx(FORCES)
    return found


def written(
    header: str, separator: str = ",", *, time: int = 1, speed: float = 1.0, force: float = 1.0, origin: int = 0
) -> str:
    """A record with other units: `time`, `speed` and `force` are theirs per SI unit."""
    times = [origin + round(t * time) if time > 1 else t for t in TIMES]
    rows = zip(times, SPEEDS, FORCES, strict=True)
    return "\n".join([header, *(f"{t}{separator}{u * speed:.9g}{separator}{x * force:.9g}" for t, u, x in rows)])


@pytest.mark.parametrize(
    ("header", "units"),
    [
        ("t,u,X", {}),
        ("Time [s];u [m/s];X [N]", {"separator": ";"}),
        ("t (ms)\tu (cm/s)\tX (kgf)", {"separator": "\t", "time": 1000, "speed": 100.0, "force": 1.0 / 9.80665}),
        ("timestamp_us,surge_velocity_mmps,thrust_x_kN", {"time": 10**6, "speed": 1e3, "force": 1e-3}),
        ("t u X", {"separator": " "}),
        ("__time,/odom/twist/twist/linear/x,/thrust/wrench/force/x", {}),
        ("Timestamp,Surge,Fx (N)", {"time": 1000, "origin": 1_700_000_000_000}),
        ("stamp,vx,fx", {"time": 10**9, "origin": 1_700_000_000_000_000_000}),
        ("t,u_kn,X_lbf", {"speed": 3600.0 / 1852.0, "force": 1.0 / 4.4482216152605}),
    ],
)
def test_names_and_units_of_others(header: str, units: dict[str, Any]) -> None:
    is_read(written(header, **units))


def test_rates_angles_and_moments_have_their_units() -> None:
    found = read_csv("t,r_degps,N_mNm,pitch (°),depth_cm\n0,180,500,90,150\n", "x.csv")
    assert found.velocity[0, 5] == pytest.approx(math.pi)
    assert found.wrench[0, 5] == pytest.approx(0.5)
    assert found.attitude[0, 1:].tolist() == pytest.approx([math.pi / 2.0, 1.5])


def test_a_line_of_units_below_the_header_line() -> None:
    is_read(written("t,u,X\nms,cm/s,N", time=1000, speed=100.0))


def test_decimal_commas_where_semicolons_part_the_cells() -> None:
    is_read(written("t,u,X", ";").replace(".", ",").replace("t,u,X", "t;u;X"))


def test_lines_above_the_header_line_are_passed_over() -> None:
    is_read('% of a pool\n"recorded in May, by hand"\n' + written("t,u,X"))


def test_a_header_line_that_is_repeated_is_passed_over() -> None:
    header, *rows = written("t,u,X").split("\n")
    is_read("\n".join([header, *rows[:2], header, *rows[2:]]))
    header, units, *rows = written("t,u,X\nms,cm/s,N", time=1000, speed=100.0).split("\n")
    is_read("\n".join([header, units, *rows[:2], header, units, *rows[2:]]))


def test_a_line_that_repeats_another_is_one_measurement() -> None:
    """Taken for two, they made deviations smaller by the root of two, and bursts of receipt that nobody had."""
    header, *rows = written("t,u,X").split("\n")
    found = is_read("\n".join([header, *(row for row in rows for _ in range(2))]))
    assert "3 lines that repeat others were left out" in found.assumptions
    is_read("\n".join([header, *rows, *rows]))


def test_equal_lines_of_a_coarse_clock_are_measurements() -> None:
    found = read_csv("t,u,X\n0,0,0\n0,0,0\n0,1,2\n1,2,3\n", "x.csv")
    assert found.velocity_t.tolist() == [0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("row", "wanted"),
    [
        ('"0,0","0,1","5,0"', "line 2, column t: found '0,0', wanted seconds with a decimal point, or a"),
        ('0.0,"0,1",5.0', "line 2, column u: found '0,1', wanted a number with a decimal point"),
        (
            "05.03.2024 12:00:00,0.1,5",
            "line 2, column t: found '05.03.2024 12:00:00', wanted seconds with a decimal point, or a",
        ),
    ],
)
def test_numbers_in_other_digits_are_no_units(row: str, wanted: str) -> None:
    with pytest.raises(HindraxError, match=wanted):
        read_csv(f"t,u,X\n{row}\n", "x.csv")


def test_dates_are_times() -> None:
    dated = [f"2024-05-01T12:00:{t:06.3f}Z,{u},{x}" for t, u, x in zip(TIMES, SPEEDS, FORCES, strict=True)]
    assert is_read("\n".join(["time,u,X", *dated])).origin_s == 1714564800.0


def test_a_stamp_in_two_columns() -> None:
    parts = [f"1700000000,{round(t * 1e9)},{u},{x}" for t, u, x in zip(TIMES, SPEEDS, FORCES, strict=True)]
    is_read("\n".join(["header.stamp.sec,header.stamp.nanosec,twist.linear.x,wrench.force.x", *parts]))


def test_cells_that_say_nothing_have_many_names() -> None:
    found = read_csv("t,u,X\n0,1,2\n1,NaN,#N/A\n2,-,null\n3,inf,\n", "x.csv")
    assert found.velocity_t.tolist() == found.wrench_t.tolist() == [0.0]


def test_given_axes_are_turned() -> None:
    text = "t,v,Y,roll,pitch,depth\n0,1,2,0.1,0.2,3\n"
    found = read_csv(text, "x.csv", "flu")
    assert found.velocity[0, 1] == -1.0
    assert found.wrench[0, 1] == -2.0
    assert found.attitude[0].tolist() == [0.1, -0.2, 3.0]
    assert read_csv(text, "x.csv", "fsd").velocity[0, 1] == 1.0


def test_decimal_commas_between_commas_move_nothing_unseen() -> None:
    with pytest.raises(HindraxError, match=r"x\.csv, line 3: found 5 cells, wanted 3 as in the header line"):
        read_csv("t,u,X\n0,1,2\n0,5,1,5,2\n", "x.csv")
    assert len(read_csv("t,u,X\n0,1,2,,\n", "x.csv").velocity_t) == 1


@pytest.mark.parametrize("header", ["linear_acceleration.x", "temperature", "V", "z", "mag_x", "t_air", "", "pwm_x_y"])
def test_what_means_nothing_is_left_alone(header: str) -> None:
    assert meaning_of(header) is None


@pytest.mark.parametrize(
    ("header", "remedy"),
    [
        ("t,speed_kn,X", "call it u_kn for surge or v_kn for sway or w_kn for heave, if it has the sign of the motion"),
        (
            "t,vx_enu,vy_enu",
            "vx_enu, vy_enu are along axes of the world: name them vn, ve and vd",
        ),
        ("t,velocity_north,v_e,X", "vn and ve are turned into u and v by a column yaw, and with vd, roll and pitch"),
        ("t,q0,q1,q2,q3,X", "are a quaternion without names of its parts: call them qw, qx, qy and qz"),
        ("t,u,Thrust", "Thrust names no axis: call it X for surge"),
        ("t,u_furlongs,X", "u_furlongs: the unit 'furlongs' is none of m/s, cm/s"),
    ],
)
def test_an_incomplete_column_name_is_refused_with_what_it_lacks(header: str, remedy: str) -> None:
    with pytest.raises(HindraxError, match=remedy):
        read_csv(f"{header}\n0,1,2\n", "x.csv")


def test_a_record_of_a_million_lines_is_refused_before_it_takes_memory() -> None:
    text = "t,u,X\n" + "0,1,2\n" * 1_000_000
    tracemalloc.start()
    with pytest.raises(HindraxError, match="found 1000001 lines, wanted at most 250000; keep"):
        read_csv(text, "long.csv")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < len(text)
