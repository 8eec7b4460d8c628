"""`hindrax benchmark`: records of foreign plants, answers of any tool to them, and the table of how well they did."""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from hindrax_analysis.identification.executor import add_workers, workers_of
from hindrax_analysis.terminal import print_answer, print_table, working
from hindrax_cli.argument_types import add_json, at_least
from hindrax_cli.command import command, option
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_fitted, print_stderr
from hindrax_core.text.text_file import replace_text, writing
from hindrax_laboratory.benchmark.blind_benchmark import (
    METHODS,
    TRUTH,
    Common,
    Row,
    answers,
    common,
    make,
    read_answers,
    score,
)

ABOUT = """
`make` flies ellipsoids in the fluid of MuJoCo (pip install mujoco) and writes a record and its questions per file, the
truth apart from them; `answer` writes the answers of the methods here, METHOD.json in the folder; `score` prints a
table of these and of files of other tools. The format is in docs/how-to/benchmark.md.
"""
MAKE, ANSWER, SCORE = "make", "answer", "score"
JOINT = "joint"
"""The method beside which others stand, where it has answered."""


def _about(parser: argparse.ArgumentParser) -> None:
    parser.description = f"{parser.description}\n{ABOUT}"


@command(
    "./hindrax benchmark make records --only small-pilot --seeds 7\n"
    "./hindrax benchmark answer records --method joint\n"
    "./hindrax benchmark score records theirs.json",
    _about,
    option("what", choices=(MAKE, ANSWER, SCORE), help="in this order"),
    option("folder", type=Path, metavar="FOLDER", help="of the records"),
    option("files", type=Path, nargs="*", metavar="JSON", help="score: answers of other tools"),
    option("--method", nargs="+", choices=sorted(METHODS), help="answer: by these; default: all that are installed"),
    option(
        "--seeds",
        nargs="+",
        type=at_least(0),
        default=[1, 2],
        metavar="N",
        help="make: one record of each; default 1 2",
    ),
    option("--only", default="", metavar="NAME", help="make: records with this in their name, such as small-pilot"),
    add_workers,
    add_json,
)
def benchmark(arguments: argparse.Namespace) -> int:
    """Records of foreign plants, answers of any tool, and the table of both."""
    folder: Path = arguments.folder
    if arguments.files and arguments.what != SCORE:
        raise UsageError(f"found {arguments.files[0]}, wanted files of answers with `{SCORE}` alone")
    if arguments.what == MAKE:
        with working("flying records") as reached:
            make(folder, arguments.only, arguments.seeds, workers_of(arguments), reached)
        records = sorted(file.stem for file in folder.glob("*.npz"))
        return print_answer({"records": records}, lambda: print_fitted(", ".join(records)), as_json=arguments.json)
    if not any(folder.glob("*.npz")):
        raise UsageError(f"{folder}: holds no records; `./hindrax benchmark make {folder}` writes them")
    if arguments.what == ANSWER:
        return _answer(arguments)
    if not (folder / TRUTH).is_file():
        raise UsageError(f"{folder}: has no {TRUTH}; `make` writes it next to the records")
    truth = json.loads((folder / TRUTH).read_text(encoding="utf-8"))
    found = [folder / f"{name}.json" for name in METHODS if (folder / f"{name}.json").is_file()]
    given = {file.stem: read_answers(file) for file in [*found, *arguments.files]}
    for name, one in given.items():
        if unknown := sorted(one.keys() - truth.keys()):
            some = ", ".join(unknown[:3]) + (", ..." if len(unknown) > 3 else "")
            print_stderr(f"{name}: left out, as {folder} holds no such record: {some}")
    rows = {name: score(truth, one) for name, one in given.items()}
    reference = JOINT if JOINT in given else next(iter(given), "")
    shared = {name: common(truth, given[reference], one) for name, one in given.items() if name != reference}
    document = {
        "axes": sum(len(one["drag"]) for one in truth.values()),
        "rows": {k: asdict(r) for k, r in rows.items()},
        "common": {"with": reference, "rows": {name: asdict(one) for name, one in shared.items()}},
    }

    def show() -> None:
        """Over all axes of each, then over those in common with the first."""
        print_rows(rows)
        if shared:
            print_common(reference, shared)

    return print_answer(document, show, as_json=arguments.json)


def _answer(arguments: argparse.Namespace) -> int:
    """Write the answers of methods; one that is not installed is named, where it was not asked for by name."""
    written = []
    for name in arguments.method or METHODS:
        try:
            with working(f"answering by {name}") as reached:
                found = answers(arguments.folder, name, workers_of(arguments), reached)
        except UsageError as error:
            if arguments.method:
                raise HindraxError(f"{name}: {error}") from error
            print_stderr(f"left out: {name} {error}")
            continue
        file = arguments.folder / f"{name}.json"
        with writing(file):
            replace_text(file, json.dumps(found, indent=1))
        written.append(str(file))
        print_stderr(f"answered: {file}")
    return print_answer({"answers": written}, lambda: None, as_json=arguments.json)


def print_rows(rows: dict[str, Row]) -> None:
    """Print one line per tool."""
    title = "Drag at three speeds and added mass of each axis, against the truth"
    heads = ("axes answered", "median error", "median std", "in the 95 % interval", "worst [std]")
    print_table(title, ("answers",), heads, [(name, *_cells(row)) for name, row in rows.items()])


def print_common(reference: str, shared: dict[str, Common]) -> None:
    """Print one line per tool beside the reference: medians over the axes that both answered."""
    heads = ("in common", f"median error, {reference}", "median error", f"median std, {reference}", "median std")
    lines = []
    for name, one in shared.items():
        numbers = (one.ours.error, one.theirs.error, one.ours.band, one.theirs.band)
        lines.append((name, f"{one.axes} axes", *("" if x is None else f"{x:.0%}" for x in numbers)))
    print_table(f"Over the axes that both answered, compared with {reference}", ("answers",), heads, lines)


def _cells(row: Row) -> Sequence[str]:
    shares = (row.answered, row.error, row.band, row.covered)
    return (*("" if one is None else f"{one:.0%}" for one in shares), "" if row.worst is None else f"{row.worst:.1f}")
