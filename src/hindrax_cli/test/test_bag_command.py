"""The words of `hindrax bag`, on a small bag and on one that was cut off."""

import contextlib
import csv
import json
import resource
import shlex
import stat
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from hindrax_bag.metadata import Channel
from hindrax_bag.read.bag_reader import messages
from hindrax_bag.write import limits
from hindrax_bag.write.bag_writer import BagWriter
from hindrax_bag.write.limits import BagLimits
from hindrax_cli import command_line
from hindrax_cli.commands.data import bag as command
from hindrax_core.events import NS_PER_S

POINT = Channel("/demo/point", "demo_msgs/msg/Point")
WORD = Channel("/demo/word", "demo_msgs/msg/Word")
TEXTS = {"Point": "float64 x\nfloat64[2] y\n", "Word": "string text\n"}


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    made = BagWriter(tmp_path / "runs" / "bag", lambda _package, name: TEXTS[name], limits=BagLimits(keep_free_MB=0.0))
    made.open()
    made.attach("vehicle.yaml", "application/yaml", b"name: demo\n", 1)
    for index in range(100):
        stamp = NS_PER_S + index * NS_PER_S // 10
        made.write(POINT, b"\x00\x01\x00\x00" + struct.pack("<3d", index, 2.0 * index, 0.5), stamp, stamp)
        if index % 10 == 9:
            made.write(WORD, b"\x00\x01\x00\x00\x03\x00\x00\x00hi\x00", stamp, stamp)
            made.flush()
    made.close()
    return tmp_path / "runs" / "bag"


def _json(capsys: pytest.CaptureFixture[str], *words: str | Path) -> dict[str, Any]:
    code = command_line.main(["bag", *map(str, words), "--json"])
    assert code == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_info(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    document = _json(capsys, "info", bag)
    assert document["messages"] == 110
    assert document["seconds"] == pytest.approx(9.9)
    assert document["attachments"] == ["vehicle.yaml"]
    assert document["finished"]
    assert document["topics"]["/demo/point"] == {
        "type": "demo_msgs/msg/Point",
        "count": 100,
        "bytes": 2800,
        "rate_Hz": 10.1,
    }
    assert command_line.main(["bag", "info", str(bag)]) == 0
    assert "/demo/point" in capsys.readouterr().out


def test_list_knows_the_unfinished(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cut = bag.parent / "cut"
    cut.mkdir()
    (cut / "cut_0.mcap").write_bytes((bag / "bag_0.mcap").read_bytes()[:1500])
    found = {Path(one["bag"]).name: one for one in _json(capsys, "list", bag.parent)["bags"]}
    assert (found["bag"]["finished"], found["bag"]["messages"]) == (True, 110)
    assert not found["cut"]["finished"]
    assert command_line.main(["bag", "list", str(bag.parent)]) == 0
    assert "unfinished" in capsys.readouterr().out


def test_recover_states_what_the_contract_states(bag: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = bag / "bag_0.mcap"
    file.write_bytes(file.read_bytes()[:2000])
    left = len(list(messages(file)))
    document = _json(capsys, "recover", bag, "--out", bag.parent / "whole")
    assert document.keys() == {"recovered_messages", "lost_seconds", "output"}
    assert document["recovered_messages"] == left > 0
    assert 0.0 <= document["lost_seconds"] <= 1.0
    assert _json(capsys, "info", document["output"])["finished"]
    assert command_line.main(["bag", "recover", str(bag), "--out", str(bag.parent / "whole")]) == 2


def test_extract_makes_tables(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _json(capsys, "extract", bag, "--csv", tmp_path / "csv")
    with (tmp_path / "csv" / "demo_point.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 100
    assert rows[3] == {"time_s": "0.3", "stamp_ns": "1300000000", "x": "3.0", "y[0]": "6.0", "y[1]": "0.5"}
    assert command_line.main(["bag", "extract", str(bag), "--csv", str(tmp_path / "c"), "--topics", "/none"]) == 2
    assert "no message on /none" in capsys.readouterr().err


def test_plot(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "x.svg"
    document = _json(capsys, "plot", bag, "/demo/point:x", "/demo/point:y[0]", "--out", out)
    assert document["series"] == {"/demo/point:x": 100, "/demo/point:y[0]": 100}
    assert "<svg" in out.read_text()
    for wrong in ("/demo/point", "/demo/point:z", "/none:x"):
        assert command_line.main(["bag", "plot", str(bag), wrong, "--out", str(out)]) == 2
    assert "there is x, y[0], y[1]" in capsys.readouterr().err


@pytest.mark.parametrize("words", ["extract {bag} --csv {dir}/csv", "plot {bag} /demo/point:x --out {dir}/x.svg"])
def test_who_waits_for_a_large_bag_sees_that_it_goes_on(
    bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: str
) -> None:
    reported: list[str] = []

    @contextlib.contextmanager
    def working(sentence: str) -> Iterator[None]:
        reported.append(sentence)
        yield

    monkeypatch.setattr(command, "working", working)
    assert command_line.main(["bag", *words.format(bag=bag, dir=tmp_path).split()]) == 0
    assert len(reported) == 1


def test_export_keeps_topics_and_span(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "small"
    _json(capsys, "export", bag, "--topics", "/demo/point", "--from", "1", "--to", "2", "--out", out)
    found = list(messages(out))
    assert {one.topic for one in found} == {"/demo/point"}
    assert [one.decoded().x for one in found] == [float(index) for index in range(10, 21)]
    assert _json(capsys, "info", out)["attachments"] == ["vehicle.yaml"]
    assert command_line.main(["bag", "export", str(bag), "--topics", "/none", "--out", str(tmp_path / "none")]) == 2


def _fake_ssh(tmp_path: Path) -> str:
    """A stand-in for ssh: drops the name of the host and runs the line here."""
    script = tmp_path / "ssh"
    script.write_text('#!/bin/sh\nshift\nexec sh -c "$*"\n')
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    return str(script)


def test_fetch_copies_resumes_and_verifies(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, remote = tmp_path / "here", bag.parent
    words = ("fetch", "rov", "--ssh", _fake_ssh(tmp_path), "--remote", remote, "--out", out)
    whole = (bag / "bag_0.mcap").read_bytes()
    (out / "bag").mkdir(parents=True)
    (out / "bag" / "bag_0.mcap.part").write_bytes(whole[:700])
    document = _json(capsys, *words)
    assert document["copied_bytes"] == len(whole) - 700 + (bag / "metadata.yaml").stat().st_size
    assert (out / "bag" / "bag_0.mcap").read_bytes() == whole
    assert _json(capsys, *words)["copied_bytes"] == 0
    assert not list(out.rglob("*.part"))


def test_fetch_starts_over_when_what_was_there_is_of_another_file(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "here"
    (out / "bag").mkdir(parents=True)
    (out / "bag" / "bag_0.mcap.part").write_bytes(b"of another day")
    _json(capsys, "fetch", f"{bag.parent}/", "--remote", "", "--out", out)
    assert (out / "bag" / "bag_0.mcap").read_bytes() == (bag / "bag_0.mcap").read_bytes()


HOSTILE = """#!/bin/sh
# Stands in for a machine that answers a `find` with names of its own making.
shift
case "$*" in
  *find*) printf '%b' "$LISTED" ;;
  *sha256sum*) printf '%s  -\\n' "${SUM-9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08}" ;;
  *tail*) printf test ;;
esac
"""


@pytest.mark.parametrize(
    ("listed", "reported"),
    [
        ("4 /{out}/../victim.txt\\0", "is not relative"),
        ("4 ../victim.txt\\0", "leads out of the folder"),
        ("4 a/../../victim.txt\\0", "leads out of the folder"),
        ("4 a\\n4 /victim.txt\\0", "contains a control character"),
        ("4 a\\033[2J\\0", "contains a control character"),
        ("4 good.mcap\\00004 ../victim.txt\\0", "leads out of the folder"),
        ("four a\\0", "has a size of 'four'"),
        ("3 a\\0", "more than its 3 bytes came"),
        ("4 link/victim.txt\\0", "is a link, and files are fetched into none"),
        ("4 linked.txt\\0", "is a link, and files are fetched into none"),
        ("4 half\\0", "half.part: is a link"),
    ],
)
def test_what_the_other_end_calls_its_files_leads_nowhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, listed: str, reported: str
) -> None:
    out, victim, ssh = tmp_path / "out", tmp_path / "victim.txt", tmp_path / "ssh"
    out.mkdir()
    victim.write_text("mine")
    for name, target in (("link", tmp_path), ("linked.txt", victim), ("half.part", victim)):
        (out / name).symlink_to(target)
    ssh.write_text(HOSTILE)
    ssh.chmod(0o755)
    before = sorted(path.name for path in out.rglob("*"))
    monkeypatch.setenv("LISTED", listed.format(out=out))
    assert command_line.main(["bag", "fetch", "rov", "--ssh", str(ssh), "--out", str(out)]) == 1
    printed = capsys.readouterr().err
    assert reported in " ".join(printed.split())
    assert "\x1b" not in printed
    assert victim.read_text() == "mine"
    assert {path.name for path in out.rglob("*")} - set(before) <= {"a.part"}


def test_a_machine_that_answers_well_is_fetched_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    ssh = tmp_path / "ssh"
    ssh.write_text(HOSTILE)
    ssh.chmod(0o755)
    monkeypatch.setenv("LISTED", "4 a b/-x\\0")
    words = ["bag", "fetch", "rov", "--ssh", str(ssh), "--out", str(tmp_path / "out")]
    assert command_line.main(words) == 0
    assert (tmp_path / "out/a b/-x").read_text() == "test"
    monkeypatch.setenv("SUM", "")
    assert command_line.main(words) == 1
    assert "for its checksum" in capsys.readouterr().err


@pytest.mark.parametrize("host", ["-oProxyCommand=touch /tmp/x", "-4", "a\nb", "rov\x1b[2J"])
def test_a_host_that_ssh_would_take_for_an_option_is_refused(host: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line.main(["bag", "fetch", "--", host]) == 2
    assert "wanted one as ssh takes it" in capsys.readouterr().err


def test_topics_that_differ_in_a_slash_get_tables_of_their_own(tmp_path: Path) -> None:
    made = BagWriter(tmp_path / "bag", lambda _package, name: TEXTS[name], limits=BagLimits(keep_free_MB=0.0))
    made.open()
    for index, topic in enumerate(("/demo/point", "/demo_point", "/../../demo")):
        made.write(Channel(topic, POINT.type), b"\x00\x01\x00\x00" + struct.pack("<3d", index, 0.0, 0.5), 1, 1)
    made.close()
    assert command_line.main(["bag", "extract", str(tmp_path / "bag"), "--csv", str(tmp_path / "csv")]) == 0
    found = {path.name: path.read_text().splitlines()[1].split(",")[2] for path in (tmp_path / "csv").iterdir()}
    assert found == {"demo_point.csv": "0.0", "demo_point_1.csv": "1.0", "_.._demo.csv": "2.0"}


def test_fetch_states_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line.main(["bag", "fetch", f"{tmp_path}/none", "--remote", "", "--out", str(tmp_path / "x")]) == 1
    printed = capsys.readouterr().err
    assert "cannot be read" in printed
    assert printed.count("\n") == 1
    assert (
        command_line.main(["bag", "fetch", "rov", "--ssh", str(tmp_path / "no-ssh"), "--out", str(tmp_path / "x")]) == 1
    )
    assert "cannot be run" in capsys.readouterr().err


PRINTED = [
    ("info {dir}/none", 2, "does not exist, wanted a bag"),
    ("info {dir}/empty", 2, "an empty folder"),
    ("info {dir}/texts", 2, "a folder with a.txt and others"),
    ("info {dir}/texts/a.txt", 2, "is no MCAP file"),
    ("info {dir}/texts/empty.csv", 2, "is empty, and no .mcap file by its name"),
    ("recover {dir}/texts/empty.csv --out {dir}/new", 2, "is empty"),
    ("info {dir}/db3", 2, "cannot be read as a sqlite3 bag"),
    ("info {dir}/runs", 0, "110 messages"),  # the folder of a run
    ("list {dir}/none", 2, "is no folder"),
    ("list {dir}/empty", 0, "no bags below"),
    ("list {dir}/db3", 0, "x.db3 is no bag"),
    ("list {dir}/moved", 0, "no metadata.yaml: bag info reads it"),
    ("recover {dir}/texts/a.txt --out {dir}/new", 2, "is no MCAP file"),
    ("recover {bag} --out {dir}/texts", 2, "exists already"),
    ("recover {bag} --out /proc/new", 2, "cannot be written"),
    ("extract {bag} --csv {dir}/new/csv --topics /demo/point /none", 2, "no message on /none"),
    ("extract {bag} --csv {dir}/texts/a.txt", 2, "cannot be written"),
    ("extract {dir}/none --csv {dir}/new", 2, "does not exist"),
    ("plot {bag} /demo/word:text --out {dir}/a.png", 2, "there is none in its messages"),
    ("plot {bag} /demo/point:y --out {dir}/a.png", 2, "there is y[0], y[1]"),
    ("plot {bag} /demo/point:x --out {dir}/none/a.png", 2, "cannot be written"),
    ("plot {bag} /demo/point --out {dir}/a.png", 2, "wanted TOPIC:FIELD"),
    ("export {bag} --topics /none --out {dir}/new/bag", 2, "none of its messages was wanted"),
    ("export {bag} --from 3 --to 1 --out {dir}/new", 2, "a span: --to after --from"),
    ("fetch {dir}/none --remote '' --out {dir}/new", 1, "--remote names the folder"),
    ("fetch {dir}/empty --remote '' --out {dir}/new", 1, "holds no file"),
    ("fetch {dir}/runs/ --remote '' --out {dir}/texts/a.txt", 1, "name another with --out"),
    ("fetch '' --out {dir}/new", 2, "HOST is empty"),
    ("fetch rov --ssh 'sh -c \"exit 255\"' --out {dir}/new", 1, "is it on the network"),
]


@pytest.mark.parametrize("reported", PRINTED, ids=[line for line, _, _ in PRINTED])
def test_good_and_bad_use_is_reported_in_a_sentence(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], reported: tuple[str, int, str]
) -> None:
    line, code, printed_text = reported
    for name in ("empty", "texts", "db3", "moved"):
        (tmp_path / name).mkdir()
    (tmp_path / "texts" / "empty.csv").touch()
    (tmp_path / "texts" / "a.txt").write_text("a text that is no bag")
    (tmp_path / "db3" / "x.db3").write_text("a text that is no bag")
    (tmp_path / "moved" / "x.mcap").write_bytes((bag / "bag_0.mcap").read_bytes())
    assert command_line.main(["bag", *shlex.split(line.format(dir=tmp_path, bag=bag))]) == code
    captured = capsys.readouterr()
    assert printed_text in " ".join((captured.err if code else captured.out).split())
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("words", ["extract {bag} --csv", "export {bag} --out", "recover {bag} --out"])
def test_a_full_disk_keeps_no_part_and_no_folder(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str
) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, before[1]))
    try:
        code = command_line.main(["bag", *words.format(bag=bag).split(), str(tmp_path / "new/deep/bag")])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert code == 1
    assert "cannot be written (File too large)" in " ".join(capsys.readouterr().err.split())
    assert [one.name for one in tmp_path.iterdir()] == ["runs"]


def test_a_bag_in_the_older_format_is_exported_as_ours(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    with Writer(tmp_path / "theirs", version=9, storage_plugin=StoragePlugin.SQLITE3) as theirs:
        connection = theirs.add_connection("/chatter", "std_msgs/msg/String", typestore=store)
        theirs.write(connection, 5, b"\x00\x01\x00\x00\x03\x00\x00\x00hi\x00")
    made = _json(capsys, "export", tmp_path / "theirs", "--out", tmp_path / "out")
    (found,) = messages(made["output"])
    assert (found.topic, found.received, found.decoded().data) == ("/chatter", 5, "hi")
    assert (tmp_path / "out" / "out_0.mcap").is_file()


def test_fetch_shows_a_bar_per_file(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag.rename(bag.parent / "a[b]")
    assert command_line.main(["bag", "fetch", f"{bag.parent}/", "--remote", "", "--out", str(tmp_path / "here")]) == 0
    shown = capsys.readouterr().err
    assert "a[b]/bag_0.mcap" in shown
    assert "kB" in shown or "MB" in shown


def test_a_pool_test_checks_the_disk_for_its_whole_length_before_it_starts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "free_bytes", lambda _folder: 210_000_000)
    words = ["pool-test", "--mock", "--dof", "surge", "--out", str(tmp_path / "run")]
    assert command_line.main(words) == 1
    assert "24 MB for 240 s of recording" in capsys.readouterr().err
    assert not (tmp_path / "run" / "logs").exists()


@pytest.mark.parametrize("word", ["recover", "export"])
def test_a_copy_that_nobody_can_read_ends_with_1_and_names_the_topic(
    word: str, bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    damaged = tmp_path / "damaged.mcap"
    with damaged.open("wb") as stream:
        made = McapWriter(stream)
        made.start("ros2")
        schema = made.register_schema("demo_msgs/msg/Level", "ros2msg", b"float64 level\n")
        channel = made.register_channel("/demo/level", "cdr", schema)
        made.add_message(channel, 1, b"\x00\x01\x00\x00", 1)
        made.finish()  # type: ignore[no-untyped-call]  # mcap leaves out its annotation
    assert command_line.main(["bag", word, str(damaged), "--out", str(tmp_path / "copy")]) == 1
    assert "/demo/level: its messages are not of demo_msgs/msg/Level" in capsys.readouterr().out
    assert command_line.main(["bag", word, str(bag), "--out", str(tmp_path / "whole")]) == 0
