"""Times of CSV files with too few digits: rows that share one are spread, where their order tells when they were."""

from pathlib import Path

import numpy as np
import pytest

from hindrax_analysis.identification.record_identification import open_sources
from hindrax_analysis.records.csv.record import COARSE_CLOCK, read_records
from hindrax_analysis.records.recording import Recording, reason_to_skip
from hindrax_analysis.records.third_party_bag import TopicSelection
from hindrax_core.errors import HindraxError
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.objections import Code

T = array(np.arange(3.2, 40.0, 0.1))
SPEEDS, FORCES = np.sin(0.7 * T), np.cos(0.4 * T)


def table(t: Array, rows: slice = slice(None)) -> str:
    lines = (f"{at:.9g},{u:.6f},{x:.6f}" for at, u, x in zip(t[rows], SPEEDS[rows], FORCES[rows], strict=True))
    return "\n".join(["t,u,X", *lines])


def read_one(text: str) -> Recording:
    (one,) = read_records(text, "x.csv")
    return one


@pytest.mark.parametrize("rounded", [np.floor, np.round, np.ceil])
def test_rows_of_a_clock_of_whole_seconds_are_spread(rounded: np.ufunc) -> None:
    """Velocities alone were spread, and came up to a second late to their forces: the drag was refused."""
    found = read_one(table(array(rounded(T))))
    assert COARSE_CLOCK in found.assumptions
    assert found.velocity_t.tolist() == found.wrench_t.tolist()
    assert np.diff(found.velocity_t) == pytest.approx(0.1, abs=0.012)
    assert found.velocity[:, 0].tolist() == pytest.approx(SPEEDS.tolist(), abs=1e-6)


def test_rows_before_a_pause_are_not_spread_over_it() -> None:
    t = np.floor(np.where(T > 20.0, T + 60.0, T))
    steps = np.diff(read_one(table(array(t))).velocity_t)
    *usual, longest = sorted(steps.tolist())
    assert longest > 58.0
    assert max(usual) < 0.16


def test_a_force_that_changes_at_the_time_of_the_last_velocity_is_not_spread() -> None:
    held = np.repeat(SPEEDS[::4], 4)
    lines = [f"{at:.1f},{u:.6f},{x:.6f}" for at, u, x in zip(np.repeat(T[::4], 4), held, FORCES, strict=True)]
    assert COARSE_CLOCK not in read_one("\n".join(["t,u,X", *lines])).assumptions


def test_a_table_of_bag_extract_has_the_time_in_front_of_its_fields() -> None:
    """A stamp, or a time of the autopilot, among the fields of the message meant the same, and was refused."""
    begin_ns = 1_700_000_000_000_000_000
    lines = ["time_s,stamp_ns,timestamp,header.stamp.sec,header.stamp.nanosec,body_velocity.x,wrench.force.x"]
    for at, u, x in zip(T, SPEEDS, FORCES, strict=True):
        stamp_ns = begin_ns + round(1e9 * at)
        boot_us = 5_000_000 + round(1.1e6 * at)
        lines.append(f"{at + 0.7:.3f},{stamp_ns},{boot_us},{stamp_ns // 10**9},{stamp_ns % 10**9},{u:.6f},{x:.6f}")
    found = read_one("\n".join(lines))
    assert found.origin_s + found.velocity_t[0] == pytest.approx(1e-9 * begin_ns + T[0])
    assert np.diff(found.velocity_t) == pytest.approx(0.1, abs=1e-6)


def test_velocities_in_an_array_ask_for_their_frame() -> None:
    fields = [
        f"{name}[{n}]" for name, count in (("q", 4), ("velocity", 3), ("angular_velocity", 3)) for n in range(count)
    ]
    text = "\n".join([f"t,{','.join(fields)},X", *(f"{at},{','.join('0' * 11)}" for at in range(9))])
    with pytest.raises(
        HindraxError,
        match=r"; velocity\[0\], velocity\[1\], velocity\[2\] are velocities without a frame: call them u, v and w",
    ):
        read_records(text, "x.csv")


def test_times_whose_digits_are_lost_are_refused() -> None:
    """As 32-bit numbers, seconds since 1970 are 128 s apart: "the drag is -0.969 N, wanted above 0"."""
    short = np.asarray(1.7e9 + 40.0 + T, dtype=np.float32)
    with pytest.raises(HindraxError, match=r"368 lines have only \d different times, .*: their digits are lost"):
        read_records(table(array(short.astype(float))), "x.csv")


def test_days_are_a_unit_and_times_in_days_are_said_to_be_no_seconds() -> None:
    """The serial numbers of a spreadsheet; "no stretch of the record has enough samples" was said."""
    lines = table(array(45_413.5 + T / 86_400.0)).split("\n")[1:]
    digits = [f"{45_413.5 + at / 86_400.0:.12f},{line.split(',', 1)[1]}" for at, line in zip(T, lines, strict=True)]
    named = read_one("\n".join(["t_d,u,X", *digits]))
    assert named.duration_s == pytest.approx(np.ptp(T), abs=1e-3)
    unnamed = read_one("\n".join(["t,u,X", *digits]))
    assert reason_to_skip(unnamed, 0).code is Code.FAST_VELOCITIES


def test_what_a_power_cut_left_of_a_file_is_read(tmp_path: Path) -> None:
    file = tmp_path / "cut.csv"
    file.write_bytes(table(T).encode() + b"\n" + bytes(4096))
    (source,) = open_sources([file], TopicSelection())
    assert source.recording is not None
    assert len(source.recording.velocity_t) == len(T)


def test_an_unreadable_cell_is_not_shown_whole() -> None:
    with pytest.raises(HindraxError, match=r"found 'x{40}\.\.\.', wanted a number") as refused:
        read_one(f"t,u,X\n0,{'x' * 5000},1\n")
    assert len(str(refused.value)) < 200
