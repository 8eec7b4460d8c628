"""`hindrax bag`: inspect, recover, extract, plot, export and fetch bags."""

import argparse
import contextlib
import math
import shutil
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from rich import progress
from rich.console import Console

from hindrax_analysis.terminal import print_answer, print_table, screen_rows, working
from hindrax_bag.read.mcap_records import Damage
from hindrax_bag.read.message_columns import FieldSeries, extract, series
from hindrax_bag.read.recovery import Recovered, recover
from hindrax_bag.read.survey import ListedBag, Survey, find_bags, survey
from hindrax_cli.argument_types import add_json
from hindrax_cli.bag_fetch import Progress, fetch, remote_of
from hindrax_cli.command import add_words, command, option
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import UNBOUNDED, print_fitted, print_stderr
from hindrax_core.text.text_file import nothing_left, require_place, writing

PLOTS = (".png", ".svg", ".pdf")
BAG = option("bag", type=Path, metavar="BAG", help="folder of a bag, or one of its files")
OUT = option("--out", type=Path, metavar="PATH", help="where the result goes")
ALL = option("--all", action="store_true", help="every topic, also where the screen has no room")
LIST_LINES = 4
"""Title, heading and the sentence below the list."""
INFO_LINES = 7
"""Of a survey beside its topics and notes: title, heading, what had no room."""
TOPICS = option("--topics", nargs="+", metavar="TOPIC", help="only these; default all")


@command("./hindrax bag info runs/2026-01-31_14-00-00/bag", BAG, ALL, add_json)
def info(arguments: argparse.Namespace) -> int:
    """Topics, counts, rates and times of a bag."""
    with working("messages read") as progress:
        found = survey(arguments.bag, progress)
    return print_answer(found.document(), lambda: _show_info(found, whole=arguments.all), as_json=arguments.json)


def _show_info(found: Survey, *, whole: bool = False) -> None:
    """Print the topics; of more than the screen has room for only the busiest, unless the `whole` bag is asked for."""
    notes = [f"inside: {', '.join(found.inside) or 'no files'}", *found.damage.sentences]
    if found.damage.unfinished:
        notes.append(f"the bag is unfinished; ./hindrax bag recover {found.bag} completes it")
    shown, room = found.topics, UNBOUNDED if whole else screen_rows() - INFO_LINES - len(notes)
    if len(shown) > room:
        busiest = sorted(shown, key=lambda name: -shown[name].count)[: max(1, room)]
        shown = {name: shown[name] for name in busiest}
        notes.insert(0, f"{len(found.topics) - len(shown)} more topics with fewer messages: --all shows them")
    title = f"{found.bag}: {found.seconds:.1f} s, {found.messages} messages, {_mb(found.size_bytes)}"
    rows = [
        (name, one.type, one.count, f"{found.rate_Hz(one):g}", one.bytes // max(1, one.count))
        for name, one in sorted(shown.items())
    ]
    print_table(title, ("topic", "type"), ("messages", "Hz", "bytes each"), rows, spare=("bytes each", "type"))
    for note in notes:
        print_fitted(note)


@command(
    "./hindrax bag list runs",
    option("folder", type=Path, nargs="?", default=Path("runs"), help="default: runs"),
    option("--all", action="store_true", help="every bag, also where the screen has no room"),
    add_json,
)
def listed(arguments: argparse.Namespace) -> int:
    """Bags below a folder."""
    found = find_bags(arguments.folder)
    document = {"bags": [one.document() for one in found]}
    return print_answer(
        document, lambda: _show_list(found, arguments.folder, whole=arguments.all), as_json=arguments.json
    )


def _show_list(found: Sequence[ListedBag], folder: Path, *, whole: bool = False) -> None:
    """Print the bags; of more than the screen has room for only the last, unless the `whole` list is asked for."""
    rows, room = [], UNBOUNDED if whole else screen_rows() - LIST_LINES
    earlier = len(found) - max(1, room) if len(found) > room else 0
    for one in found[earlier:]:
        numbers = ("", "", one.note) if one.note else (f"{one.seconds:.1f}", one.messages, "")
        rows.append((one.bag, f"{one.bytes / 1e6:.1f}", *numbers))
    if rows:
        print_table(f"bags below {folder}", ["bag"], ["MB", "s", "messages"], rows, [""])
        if earlier:
            print_fitted(f"{earlier} more bags, earlier by their names: --all shows them")
    else:
        print_fitted(f"no bags below {folder}")


@command("./hindrax bag recover runs/2026-01-31_14-00-00/bag", BAG, OUT, add_json)
def recovered(arguments: argparse.Namespace) -> int:
    """Recover a truncated or damaged bag."""
    bag: Path = arguments.bag
    with working("messages recovered") as progress:
        made = recover(bag, arguments.out or bag.with_name(f"{bag.stem}_recovered"), progress)
    document = {"recovered_messages": made.messages, "lost_seconds": made.lost_s, "output": str(made.output)}
    outcome = f"{made.output}: {made.messages} messages recovered, {made.lost_s:.2f} s known to be lost"
    return _answer_copy(made, document, outcome, as_json=arguments.json)


def _answer_copy(made: Recovered, document: dict[str, object], outcome: str, *, as_json: bool) -> int:
    """Print what became of a copy; 1 when a topic of it cannot be read by anybody."""
    unreadable = {"unreadable": list(made.unreadable)} if made.unreadable else {}
    print_answer(document | unreadable, "\n".join([*made.notes, outcome]), as_json=as_json)
    return 1 if made.unreadable else 0


@command(
    "./hindrax bag extract runs/2026-01-31_14-00-00/bag --csv sensors --topics /hindrax/ms5837/pressure",
    BAG,
    option("--csv", type=Path, required=True, metavar="DIR", help="folder for the files"),
    TOPICS,
    add_json,
)
def extracted(arguments: argparse.Namespace) -> int:
    """Messages as CSV files, one per topic."""
    damage = Damage()
    with working("writing tables"):
        tables = extract(arguments.bag, arguments.csv, arguments.topics, damage=damage)
    _tell(damage)
    document = {"files": {topic: {"path": str(path), "rows": rows} for topic, (path, rows) in tables.items()}}
    lines = [f"{path}: {rows} rows of {topic}" for topic, (path, rows) in sorted(tables.items())]
    return print_answer(document, "\n".join(lines), as_json=arguments.json)


@command(
    "./hindrax bag plot runs/2026-01-31_14-00-00/bag /hindrax/navigation/status:depth --out depth.png",
    BAG,
    option("fields", nargs="+", metavar="TOPIC:FIELD", help="numbers to be drawn"),
    OUT,
    add_json,
)
def plotted(arguments: argparse.Namespace) -> int:
    """Fields over time as a picture."""
    out: Path = arguments.out or Path("bag.png")
    if out.suffix not in PLOTS:
        raise UsageError(f"{out}: wanted a picture with one of {', '.join(PLOTS)}")
    require_place(out)
    damage = Damage()
    with working("drawing"):
        lines = series(arguments.bag, arguments.fields, damage=damage)
        draw(lines, out, str(arguments.bag))
    _tell(damage)
    document = {"plot": str(out), "series": {one.name: len(one.values) for one in lines}}
    return print_answer(document, out, as_json=arguments.json)


def _tell(damage: Damage) -> None:
    for sentence in damage.sentences:
        print_stderr(f"note: {sentence}")


def draw(lines: Sequence[FieldSeries], out: Path, title: str) -> None:
    """Save one panel per series over a common time axis.

    Parameters
    ----------
    lines
        Series with their names and units.
    out
        File, whose suffix names the format.
    title
        Above the panels.
    """
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


@command(
    "./hindrax bag export runs/2026-01-31_14-00-00/bag --topics /hindrax/navigation/status --to 60",
    BAG,
    TOPICS,
    option("--from", dest="begin", type=float, default=0.0, metavar="S", help="since its start"),
    option("--to", dest="end", type=float, default=math.inf, metavar="S", help="since its start"),
    OUT,
    add_json,
)
def exported(arguments: argparse.Namespace) -> int:
    """A smaller bag: some topics, or a span of time."""
    bag, begin, end, wanted = arguments.bag, arguments.begin, arguments.end, set(arguments.topics or ())
    if begin >= end:
        raise UsageError(f"found --from {begin:g} and --to {end:g}, wanted a span: --to after --from")

    def keep(topic: str, after_s: float) -> bool:
        return (not wanted or topic in wanted) and begin <= after_s <= end

    out = arguments.out or bag.with_name(f"{bag.stem}_export")
    with working("messages written") as progress, nothing_left(out):
        made = recover(bag, out, progress, keep)
        if not made.messages:
            shutil.rmtree(out)
            raise UsageError(
                f"{bag}: none of its messages was wanted; `./hindrax bag info {bag}` shows topics and length"
            )
    document = {"messages": made.messages, "output": str(made.output)}
    return _answer_copy(made, document, f"{made.output}: {made.messages} messages", as_json=arguments.json)


@command(
    "./hindrax bag fetch pi@rov.local --remote hindrax/runs --out runs",
    option("host", metavar="HOST", help="name or user@name; with a slash: a folder of this machine"),
    option("--remote", default="runs", metavar="DIR", help="folder on the vehicle; default runs"),
    option("--ssh", metavar="COMMAND", help="instead of ssh"),
    OUT,
    add_json,
)
def fetched(arguments: argparse.Namespace) -> int:
    """Bags from the vehicle over ssh, resumed and verified by checksum."""
    out = arguments.out or Path("runs")
    remote = remote_of(arguments.host, arguments.remote, arguments.ssh)
    with _bars() as bars:
        files = fetch(remote, out, bars)
    copied = sum(files.values())
    document = {"files": [str(path) for path in files], "copied_bytes": copied, "output": str(out)}
    text = f"{out}: {len(files)} files here and verified, {_mb(copied)} copied"
    return print_answer(document, text, as_json=arguments.json)


@contextlib.contextmanager
def _bars() -> Iterator[Progress]:
    """A bar per file on stderr: how much of it is here, how fast it comes, how long it will take."""
    name, bar = progress.TextColumn("{task.description}", markup=False), progress.BarColumn()
    speed = progress.DownloadColumn(), progress.TransferSpeedColumn(), progress.TimeRemainingColumn()
    bars = progress.Progress(name, bar, *speed, console=Console(stderr=True))
    tasks: dict[str, progress.TaskID] = {}

    def show(name: str, here: int, size: int) -> None:
        if not tasks:
            bars.start()  # before there is a file there is nothing to draw, not even an empty line
        if name not in tasks:
            # What was here before does not count for the speed.
            tasks[name] = bars.add_task(name, total=size, completed=here)
        bars.update(tasks[name], completed=here)

    try:
        yield show
    finally:
        if tasks:
            bars.stop()


def _mb(size: int) -> str:
    return f"{size / 1e6:.1f} MB"


WORDS = {
    "info": info,
    "list": listed,
    "recover": recovered,
    "extract": extracted,
    "plot": plotted,
    "export": exported,
    "fetch": fetched,
}


@command("./hindrax bag info runs/2026-01-31_14-00-00/bag", partial(add_words, words=WORDS))
def bag(arguments: argparse.Namespace) -> int:
    """Show, recover, cut, extract, plot and fetch bags."""
    return WORDS[arguments.word].run(arguments)
