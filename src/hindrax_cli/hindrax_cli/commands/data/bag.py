"""`hindrax bag`: inspect, recover, extract, plot, export and fetch bags."""

from __future__ import annotations

import argparse
import shlex
import shutil
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
    TransferSpeedColumn,
)

from hindrax_analysis.plain import print_json
from hindrax_analysis.terminal import make_table, print_table
from hindrax_bag.read.message_columns import Series, extract, series
from hindrax_bag.read.recovery import recover
from hindrax_bag.read.survey import ListedBag, Survey, find_bags, survey
from hindrax_cli.argument_types import add_json
from hindrax_cli.bag_fetch import SSH, fetch, remote_of
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.text.text_file import nothing_left, require_place, writing

NAME = "bag"
HELP = "show, recover, cut, extract, plot and fetch bags"
EXAMPLE = "./hindrax bag info runs/2026-01-31_14-00-00/bag"

QUIET_S = 2.0
"""Shorter work shows no progress."""
PLOTS = (".png", ".svg", ".pdf")
Argument = tuple[Sequence[str], dict[str, Any]]

BAG: Argument = (("bag",), {"type": Path, "metavar": "BAG", "help": "folder of a bag, or one of its files"})
OUT: Argument = (("--out",), {"type": Path, "metavar": "PATH", "help": "where the result goes"})
TOPICS: Argument = (("--topics",), {"nargs": "+", "metavar": "TOPIC", "help": "only these; default all"})


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """One word after `bag` per thing that can be done."""
    words = parser.add_subparsers(dest="word", required=True, metavar="WORD")
    for name, (does, arguments, example) in WORDS.items():
        one = words.add_parser(
            name,
            help=does.__doc__,
            description=does.__doc__,
            epilog=f"example:\n  ./hindrax bag {name} {example}",
            formatter_class=parser.formatter_class,
        )
        for names, options in arguments:
            one.add_argument(*names, **options)
        add_json(one)


def run(arguments: argparse.Namespace) -> int:
    """Run the subcommand and print its outcome."""
    document = WORDS[arguments.word][0](arguments)
    if arguments.json:
        print_json(document)
    return 0


def info(arguments: argparse.Namespace) -> dict[str, Any]:
    """Topics, counts, rates and times of a bag."""
    found = survey(arguments.bag, Ticker("messages read"))
    if not arguments.json:
        show_info(found)
    return found.document()


def show_info(found: Survey) -> None:
    """Print a survey."""
    title = f"{found.bag}: {found.seconds:.1f} s, {found.messages} messages, {_mb(found.size_bytes)}"
    table = make_table(title, ("topic", "type"), ("messages", "Hz", "bytes each"))
    for name, one in sorted(found.topics.items()):
        row = (str(one.count), f"{found.rate_Hz(one):g}", str(one.bytes // max(1, one.count)))
        table.add_row(name, one.type, *row)
    print_table(table)
    print_fitted(f"inside: {', '.join(found.inside) or 'no files'}")
    for note in found.damage.notes:
        print_fitted(note)
    if found.damage.unfinished:
        print_fitted(f"the bag was not finished; ./hindrax bag recover {found.bag} makes a whole one")


def listed(arguments: argparse.Namespace) -> dict[str, Any]:
    """Bags below a folder."""
    found = find_bags(arguments.folder)
    if not arguments.json:
        show_list(found, arguments.folder)
    return {"bags": [one.document() for one in found]}


def show_list(found: Sequence[ListedBag], folder: Path) -> None:
    """Print the bags below a folder."""
    table = make_table(f"bags below {folder}", ["bag"], ["MB", "s", "messages"], [""])
    for one in found:
        numbers = ("", "", one.note) if one.note else (f"{one.seconds:.1f}", str(one.messages), "")
        table.add_row(str(one.bag), f"{one.bytes / 1e6:.1f}", *numbers)
    if found:
        print_table(table)
    else:
        print_fitted(f"no bags below {folder}")


def recovered(arguments: argparse.Namespace) -> dict[str, Any]:
    """A whole, indexed bag out of one that was cut off or damaged."""
    bag: Path = arguments.bag
    output = arguments.out or bag.with_name(f"{bag.stem}_recovered")
    made = recover(bag, output, Ticker("messages recovered"))
    if not arguments.json:
        for note in made.notes:
            print_fitted(note)
        print_fitted(f"{made.output}: {made.messages} messages recovered, {made.lost_s:.2f} s known to be lost")
    return {"recovered_messages": made.messages, "lost_seconds": made.lost_s, "output": str(made.output)}


def extracted(arguments: argparse.Namespace) -> dict[str, Any]:
    """Messages as CSV files, one per topic."""
    tables = extract(arguments.bag, arguments.csv, arguments.topics)
    if not arguments.json:
        for topic, (path, rows) in sorted(tables.items()):
            print_fitted(f"{path}: {rows} rows of {topic}")
    return {"files": {topic: {"path": str(path), "rows": rows} for topic, (path, rows) in tables.items()}}


def plotted(arguments: argparse.Namespace) -> dict[str, Any]:
    """Fields over time as a picture."""
    out: Path = arguments.out or Path("bag.png")
    if out.suffix not in PLOTS:
        raise UsageError(f"{out}: wanted a picture with one of {', '.join(PLOTS)}")
    require_place(out)
    lines = series(arguments.bag, arguments.fields)
    draw(lines, out, str(arguments.bag))
    if not arguments.json:
        print_fitted(out)
    return {"plot": str(out), "series": {one.name: len(one.values) for one in lines}}


def draw(lines: Sequence[Series], out: Path, title: str) -> None:
    """Save one panel per series over a common time axis."""
    from matplotlib.figure import Figure  # noqa: PLC0415  # slow to import, and only needed here

    figure = Figure(figsize=(9.0, 1.0 + 2.2 * len(lines)), layout="constrained")
    panels = figure.subplots(len(lines), 1, sharex=True, squeeze=False)
    for panel, one in zip(panels[:, 0], lines, strict=True):
        panel.plot(one.time_s, one.values, linewidth=0.8)
        panel.set_title(f"{one.name} [{one.unit}]" if one.unit else one.name, fontsize=9, loc="left")
        panel.grid(visible=True, alpha=0.3)
    panels[-1, 0].set_xlabel("time since the first message [s]")
    figure.suptitle(title, fontsize=9)
    with writing(out, "name another with --out"), nothing_left(out):
        figure.savefig(out, dpi=120)


def exported(arguments: argparse.Namespace) -> dict[str, Any]:
    """A smaller bag: some topics, or a span of time."""
    wanted = set(arguments.topics or ())
    if arguments.begin >= arguments.end:
        raise UsageError(
            f"found --from {arguments.begin:g} and --to {arguments.end:g}, wanted a span: --to after --from"
        )

    def keep(topic: str, after_s: float) -> bool:
        return (not wanted or topic in wanted) and arguments.begin <= after_s <= arguments.end

    bag: Path = arguments.bag
    made = recover(bag, arguments.out or bag.with_name(f"{bag.stem}_export"), Ticker("messages written"), keep)
    if not made.messages:
        shutil.rmtree(made.output)
        raise UsageError(f"{bag}: none of its messages was wanted; `hindrax bag info {bag}` tells topics and length")
    if not arguments.json:
        print_fitted(f"{made.output}: {made.messages} messages")
    return {"messages": made.messages, "output": str(made.output)}


def fetched(arguments: argparse.Namespace) -> dict[str, Any]:
    """Bags from the vehicle over ssh, resumed and verified by checksum."""
    ssh = tuple(shlex.split(arguments.ssh)) if arguments.ssh else SSH
    out = arguments.out or Path("runs")
    remote = remote_of(arguments.host, arguments.remote, ssh)
    with Bars() as bars:
        files = fetch(remote, out, bars)
    copied = sum(one.copied for one in files)
    if not arguments.json:
        print_fitted(f"{out}: {len(files)} files here and verified, {_mb(copied)} copied")
    return {"files": [str(one.path) for one in files], "copied_bytes": copied, "output": str(out)}


class Bars:
    """A bar per file on stderr: how much of it is here, how fast it comes, how long it will take."""

    def __init__(self) -> None:
        columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TransferSpeedColumn())
        self._bars = Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True))
        self._tasks: dict[str, TaskID] = {}

    def __call__(self, name: str, here: int, size: int) -> None:
        """Show a file with so many bytes of its size."""
        if not self._tasks:
            self._bars.start()  # before there is a file there is nothing to draw, not even an empty line
        if name not in self._tasks:
            # What was here before does not count for the speed.
            self._tasks[name] = self._bars.add_task(name, total=size, completed=here)
        self._bars.update(self._tasks[name], completed=here)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._tasks:
            self._bars.stop()


class Ticker:
    """Progress on stderr, at most once a second, and only of work that takes longer than two."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._last = time.monotonic() + QUIET_S - 1.0

    def __call__(self, count: int) -> None:
        """Show the count so far."""
        if time.monotonic() - self._last >= 1.0:
            self._last = time.monotonic()
            print_fitted(f"{count} {self._what}", sys.stderr)


def _mb(size: int) -> str:
    return f"{size / 1e6:.1f} MB"


_EVER = float("inf")
WORDS: dict[str, tuple[Callable[[argparse.Namespace], dict[str, Any]], Sequence[Argument], str]] = {
    "info": (info, (BAG,), "runs/2026-01-31_14-00-00/bag"),
    "list": (
        listed,
        ((("folder",), {"type": Path, "nargs": "?", "default": Path("runs"), "help": "default: runs"}),),
        "runs",
    ),
    "recover": (recovered, (BAG, OUT), "runs/2026-01-31_14-00-00/bag"),
    "extract": (
        extracted,
        (BAG, (("--csv",), {"type": Path, "required": True, "metavar": "DIR", "help": "folder for the files"}), TOPICS),
        "runs/2026-01-31_14-00-00/bag --csv sensors --topics /hindrax/ms5837/pressure",
    ),
    "plot": (
        plotted,
        (BAG, (("fields",), {"nargs": "+", "metavar": "TOPIC:FIELD", "help": "numbers to be drawn"}), OUT),
        "runs/2026-01-31_14-00-00/bag /hindrax/navigation/status:depth --out depth.png",
    ),
    "export": (
        exported,
        (
            BAG,
            TOPICS,
            (("--from",), {"dest": "begin", "type": float, "default": 0.0, "metavar": "S", "help": "since its start"}),
            (("--to",), {"dest": "end", "type": float, "default": _EVER, "metavar": "S", "help": "since its start"}),
            OUT,
        ),
        "runs/2026-01-31_14-00-00/bag --topics /hindrax/navigation/status --to 60",
    ),
    "fetch": (
        fetched,
        (
            (("host",), {"metavar": "HOST", "help": "name or user@name; with a slash: a folder of this machine"}),
            (("--remote",), {"default": "runs", "metavar": "DIR", "help": "folder on the vehicle; default runs"}),
            (("--ssh",), {"metavar": "COMMAND", "help": "instead of ssh"}),
            OUT,
        ),
        "pi@rov.local --remote hindrax/runs --out runs",
    ),
}
