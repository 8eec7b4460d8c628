"""`hindrax bench`: speed, each figure beside a peer measured in the same run."""

from __future__ import annotations

import argparse
import pkgutil
import sys
from typing import Any

from hindrax_analysis.plain import print_json
from hindrax_analysis.terminal import make_table, print_table
from hindrax_bringup.clone import developer_module
from hindrax_cli.argument_types import add_json
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted

NAME = "bench"
HELP = "speed, each figure beside a peer in the same run"
EXAMPLE = "./hindrax bench rls allocation"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which benchmarks, and how to print."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="which; the default is all of them")
    add_json(parser)


def names() -> list[str]:
    """Names of all benchmarks."""
    folder = developer_module("benchmarks").__path__
    return sorted(module.name for module in pkgutil.iter_modules(folder) if not module.ispkg)


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    wanted = arguments.names or names()
    unknown = [name for name in wanted if name not in names()]
    if unknown:
        raise UsageError(f"no benchmark {unknown[0]!r}; there are {', '.join(names())}")
    rows: list[dict[str, Any]] = []
    for name in wanted:
        print_fitted(f"measuring {name} ...", sys.stderr)
        rows += developer_module(f"benchmarks.{name}").rows()
    if arguments.json:
        print_json({"rows": rows})
    else:
        show(rows)
    return 0


def show(rows: list[dict[str, Any]]) -> None:
    """Print a table."""
    table = make_table("Medians; the ratio is peer / ours", ("what",), ("ours [us]", "peer [us]", "ratio"), ("peer",))
    for row in rows:
        table.add_row(row["name"], *(_cell(row.get(key)) for key in ("ours_us", "peer_us", "ratio", "peer")))
    print_table(table)


def _cell(value: object) -> str:
    if not isinstance(value, float):
        return "" if value is None else str(value)
    text = f"{value:.3g}"
    return f"{float(text):.0f}" if "e+" in text else text
