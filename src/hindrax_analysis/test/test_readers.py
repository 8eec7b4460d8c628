"""Third-party records: columns, gaps, and the events made of them."""

import contextlib
import gzip
import math
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import MCAP0_MAGIC as MAGIC

from hindrax_analysis.identification.record_identification import TABLES, open_sources
from hindrax_analysis.records.csv.record import read_records
from hindrax_analysis.records.damage import without_damage
from hindrax_analysis.records.recording import FEWEST_VELOCITIES, Recording, events, has_signal, reason_to_skip, tuned
from hindrax_analysis.records.third_party_bag import TopicSelection
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import to_s
from hindrax_core.signals import Attitude, Phase, Thrust, Velocity
from hindrax_ident.assess.objections import Code


def read_csv(text: str, source: str, frame: str = "") -> Recording:
    (one,) = read_records(text, source, frame)
    return one


PLAIN = "t,u,X\n" + "\n".join(f"{0.1 * i:.1f},{math.sin(i):.4f},{i % 7}" for i in range(60))


def test_columns_may_have_units_in_their_names_and_any_order() -> None:
    found = read_csv("X_N; extra ;time_s;u_mps\n1;abc;5.0;0.1\n2;def;5.5;0.2\n", "x.csv")
    assert found.velocity_t.tolist() == [0.0, 0.5]
    assert found.velocity[:, 0].tolist() == [0.1, 0.2]
    assert found.wrench[:, 0].tolist() == [1.0, 2.0]
    assert found.origin_s == 5.0
    assert np.isnan(found.velocity[:, 1:]).all()


@pytest.mark.parametrize("code", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])
def test_text_is_read_in_the_code_of_any_spreadsheet(tmp_path: Path, code: str) -> None:
    file = tmp_path / "x.csv"
    file.write_bytes(PLAIN.replace("X", "X,T (\N{DEGREE SIGN}C)").encode(code))
    (found,) = open_sources([file], TopicSelection())
    assert found.recording is not None
    assert len(found.recording.velocity_t) == 60


def test_what_is_missing_in_a_damaged_bag_may_be_what_it_lost(tmp_path: Path) -> None:
    file, chunk = tmp_path / "x.mcap", struct.pack("<BQQQ", 6, 1000, 0, 10**9)
    file.write_bytes(MAGIC + chunk)
    with pytest.raises(
        UsageError, match=r"it holds nothing; x\.mcap: the file ends in the middle of a chunk, at byte 8"
    ):
        open_sources([file], TopicSelection())


def test_rates_may_differ_and_rows_may_be_out_of_order() -> None:
    found = read_csv("# a comment\nt,u,X,roll\n1.0,,5,\n0.0,0.1,,\n2.0,nan,6,0.2\n3.0,0.3,,\n", "x.csv")
    assert found.velocity_t.tolist() == [0.0, 3.0]
    assert found.wrench_t.tolist() == [1.0, 2.0]
    assert found.attitude_t.tolist() == [2.0]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "found 0 lines"),
        ("t,u,X", "found 1 line,"),
        ("t,u,Y\n0,1,2", "u and X"),
        ("u,X\n0,1", "wanted t"),
        ("t,u,X\n0,fast,2", "line 2, column u: found 'fast'"),
        ("t,u,X\n0,1,2\n,1,2", "line 3: no time"),
        ("t,u,u_mps,X\n0,1,1,2", "columns u and u_mps mean the same"),
        ('t,u,X\n0,1,"2\n1,1,2', "quotation mark"),
        ("t,u (furlong/s),X\n0,1,2", "unit 'furlong/s', wanted one of m/s"),
        ("t,u,X\ns,parsec,N\n0,1,2", "column u [parsec]: found the unit 'parsec'"),
        ("t,u,lamp\n0,1,1600", "forces are missing"),
        ("velocity,force\n0.1,2", "hindrax towing"),
        ("t,u,X\n1,1,2\n1,2,3", "all times are the same"),
    ],
)
def test_what_is_wrong_is_named(text: str, named: str) -> None:
    with pytest.raises(HindraxError, match=r"x\.csv") as caught:
        read_csv(text, "x.csv")
    assert named in str(caught.value)


@settings(deadline=None)
@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(text: str) -> None:
    with contextlib.suppress(HindraxError):
        assert read_csv(text, "x.csv").source == "x.csv"


def test_events_are_in_order_and_end_the_motion() -> None:
    found = list(events(read_csv(PLAIN, "x.csv"), 0))
    assert [event.stamp for event in found] == sorted(event.stamp for event in found)
    assert sum(isinstance(event.reading, Velocity) for event in found) == 60
    assert sum(isinstance(event.reading, Thrust) for event in found) == 60
    phases = [event.reading for event in found if isinstance(event.reading, Phase)]
    assert phases == [Phase("surge", "excite"), Phase("", "")]


def test_a_second_record_begins_at_a_given_time() -> None:
    first = next(iter(events(read_csv(PLAIN, "x.csv"), 0, 2000.0)))
    assert to_s(first.stamp) == 2000.0


def test_depth_serves_heave_only_where_no_velocity_was_measured() -> None:
    rows = "\n".join(f"{0.1 * i},{i},{0.2 * i},{0.5 * i}" for i in range(5))
    with_w = list(events(read_csv("t,Z,w,depth\n" + rows, "x.csv"), 2))
    without = list(events(read_csv("t,Z,x,depth\n" + rows, "x.csv"), 2))
    assert not any(isinstance(event.reading, Attitude) for event in with_w)
    assert [event.reading.depth_m for event in without if isinstance(event.reading, Attitude)] == [0, 0.5, 1, 1.5, 2]


def test_a_cut_keeps_the_force_in_force() -> None:
    cut = read_csv(PLAIN, "x.csv").between(2.05, 4.0)
    assert cut.velocity_t[0] == pytest.approx(2.1)
    assert cut.velocity_t[-1] == pytest.approx(4.0)
    assert cut.wrench_t[0] == pytest.approx(2.05)
    assert cut.wrench[0, 0] == 20 % 7


def test_a_clock_that_was_set_leaves_a_pause_that_is_no_year() -> None:
    """A step of a year, as of a clock that the network sets, took gigabytes."""
    text = "t,u,X\n" + "\n".join(f"{0.1 * i + 3.2e7 * (i > 20)},{i % 5},{i % 7}" for i in range(40))
    cut = read_csv(text, "x.csv").between(0.0, math.inf)
    assert cut.duration_s == pytest.approx(1000.0 + 3.8)
    assert cut.velocity_t.tolist() == cut.wrench_t.tolist()
    assert np.diff(cut.velocity_t)[[0, 19, 21, 38]] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("row", "code"),
    [
        (lambda i: (0.1 * i, 0.3, 0.0), Code.CONSTANT_THRUST),
        (lambda i: (0.1 * i, 0.0, i % 3), Code.CONSTANT_VELOCITY),
        (lambda i: (0.1 * i, 0.1 * i if i < FEWEST_VELOCITIES - 1 else "", i), Code.FEW_VELOCITIES),
        (lambda i: (100 * i, i % 3, i % 5), Code.SLOW_VELOCITIES),
        (lambda i: (0.1 * i, i if i < 25 else "", "" if i < 30 else i), Code.LATE_THRUST),
    ],
)
def test_why_nothing_can_be_learned_is_reported(row: Callable[[int], tuple[object, ...]], code: Code) -> None:
    text = "t,u,X\n" + "\n".join(",".join(map(str, row(i))) for i in range(40))
    assert reason_to_skip(read_csv(text, "x.csv"), 0).code is code


def test_axes_that_do_not_meet_are_named() -> None:
    text = "t,u,X,Y\n" + "\n".join(f"{0.1 * i},{i % 7},0,{i % 3}" for i in range(40))
    assert "(on sway it does)" in reason_to_skip(read_csv(text, "x.csv"), 0)


def test_a_record_that_moves_has_no_objection() -> None:
    assert not reason_to_skip(read_csv(PLAIN, "x.csv"), 0)
    assert has_signal(read_csv(PLAIN, "x.csv"), 0)
    assert not has_signal(read_csv(PLAIN, "x.csv"), 5)


def test_a_slow_topic_is_not_a_pause() -> None:
    slow = read_csv("t,u,X\n" + "\n".join(f"{2 * i},{i % 5},{i % 3}" for i in range(30)), "x.csv")
    knobs = tuned([slow])
    assert knobs.gap_s > 2.0
    assert knobs.thrust_age_s > 2.0


def test_regular_forces_that_pause_are_unknown_and_those_at_changes_hold() -> None:
    """Held for 2 s, the last force of a stream that was lost spoiled the result: k_q 66 +- 19 for 60."""

    def read(every_s: float, pause_s: float) -> Recording:
        times = [t for t in np.arange(0.0, 60.0, every_s).tolist() if not 20.0 < t < 20.0 + pause_s]
        return read_csv("t,u,X\n" + "\n".join(f"{t:.3f},{i % 5},{1 + i % 3}" for i, t in enumerate(times)), "x.csv")

    lost = read(0.05, 1.5)
    assert tuned([lost]).thrust_age_s == 0.5
    (note,) = (one for one in without_damage(lost).assumptions if "no force" in one)
    assert note == "no force for 1.5 s in one pause, the longest of 1.5 s after 20 s: what moved meanwhile is left out"
    assert tuned([read(0.05, 0.0)]).thrust_age_s == 0.5
    changes = read_csv("t,u,X\n" + "\n".join(f"{(i**1.5):.3f},{i % 5},{i % 3}" for i in range(60)), "x.csv")
    assert tuned([changes]).thrust_age_s > 10.0
    assert tuned([lost, changes]).thrust_age_s > 10.0


@pytest.mark.parametrize("ending", TABLES)
def test_a_table_of_another_program_is_to_be_saved_as_csv(ending: str, tmp_path: Path) -> None:
    file = tmp_path / f"dive{ending.upper()}"
    file.write_bytes(b"PK\3\4")
    with pytest.raises(UsageError, match=r"is a table in a format that is not read; save it as CSV"):
        open_sources([file], TopicSelection())


@pytest.mark.parametrize(
    "packed",
    [gzip.compress(b"t,u,X\n0,1,2\n1,2,3\n", mtime=0), bytes(range(1, 256)) * 20],
    ids=["gzip, which has the time in it", "any bytes"],
)
def test_what_is_no_text_is_not_printed_to_the_terminal(packed: bytes, tmp_path: Path) -> None:
    file = tmp_path / "dive.csv"
    file.write_bytes(packed)
    with pytest.raises(UsageError, match=r"holds no text, by its first characters; unpack it") as refused:
        open_sources([file], TopicSelection())
    assert str(refused.value).isprintable()
