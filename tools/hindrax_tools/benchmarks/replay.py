"""A recorded run through the real code again and compared, beside only reading the same bag with the mcap reader."""

import importlib.metadata
from pathlib import Path

from mcap.reader import make_reader

from hindrax_bag.read.bag_reader import bag_files, messages
from hindrax_bringup.clone import clone_root
from hindrax_core.errors import UsageError
from hindrax_replay.bag_replay import replay
from hindrax_tools.benchmarks import interleaved_us, row

PASSES = 5
REAL_TIME_WANTED = 50.0


def rows() -> list[dict[str, object]]:
    """Rows of reading and replaying a reference bag, per second of the record. Medians over interleaved passes."""
    bag = clone_root() / "test" / "replay" / "bags" / "surge"
    if not bag.is_dir():
        raise UsageError(f"{bag}: found no reference bag; this benchmark works in a clone of the repository")
    seconds = replay(bag).vehicle_s
    calls = (lambda: _read(bag), lambda: _peer(bag), lambda: replay(bag))
    read, peer, again = (one_us / seconds for one_us in interleaved_us(calls, PASSES))
    name = f"mcap {importlib.metadata.version('mcap')}, reading alone"
    speed = f"replay one second of a bag and compare ({1e6 / again:.0f} times real time, {REAL_TIME_WANTED:.0f} wanted)"
    return [row("read one second of a bag", read, name, peer), row(speed, again, name, peer)]


def _read(bag: Path) -> int:
    return sum(1 for _ in messages(bag))


def _peer(bag: Path) -> int:
    with bag_files(bag)[0].open("rb") as stream:
        return sum(1 for _ in make_reader(stream).iter_messages())
