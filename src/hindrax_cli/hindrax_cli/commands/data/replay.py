"""`hindrax replay`: a recorded run through the real code, compared field by field with the record."""

import argparse
from pathlib import Path

from hindrax_analysis.terminal import print_answer, working
from hindrax_bag.message_comparison import TOLERANCES, ComparisonReport, load_rules
from hindrax_bag.read.bag_reader import attached_vehicle, attachments
from hindrax_bringup.clone import clone_root
from hindrax_cli.argument_types import add_json, named_vehicle
from hindrax_cli.command import command, option
from hindrax_core.errors import UsageError
from hindrax_core.text.screen_text import print_fitted, print_stderr
from hindrax_core.vehicle import load_vehicle
from hindrax_replay.bag_replay import Replayed, check_reference, names_of, reference_file, write_reference
from hindrax_replay.bag_replay import replay as replay_bag
from hindrax_replay.ros_replay import replay_ros

SHOWN = 30


def _way(parser: argparse.ArgumentParser) -> None:
    way = parser.add_mutually_exclusive_group()
    way.add_argument("--pure", action="store_true", help="without ROS, as fast as possible (default)")
    way.add_argument("--ros", action="store_true", help="the real processes on the recorded wires, with /clock")


@command(
    "./hindrax replay runs/2026-01-31_14-00-00/bag",
    option("bags", nargs="*", type=Path, metavar="BAG", help="folder of a bag, or one of its files"),
    _way,
    option("--all", action="store_true", help="every reference bag of this clone, against its reference"),
    option("--update-refs", action="store_true", help="with --all: write the references, print the changes"),
    option("--remap", action="append", default=[], metavar="THEIRS:=OURS", help="read a topic under our name"),
    named_vehicle("vehicle, for bags that have no file of it inside"),
    option("--tolerances", type=Path, default=TOLERANCES, metavar="FILE", help="default: ours"),
    option("--out", type=Path, metavar="DIR", help="with --ros and one bag: store the new bag"),
    add_json,
)
def replay(arguments: argparse.Namespace) -> int:
    """Run recorded wire frames through the real code, and compare with the record."""
    if arguments.update_refs and not arguments.all:
        raise UsageError("--update-refs is for --all only: references belong to the reference bags")
    if arguments.ros and arguments.update_refs:
        raise UsageError("--update-refs is for --pure: processes depend on timing")
    if arguments.out and not (arguments.ros and len(arguments.bags) == 1):
        raise UsageError("--out is for --ros with one bag")
    if arguments.all == bool(arguments.bags):
        raise UsageError("name one or more bags, or --all for the reference bags")
    done = []
    for bag in _reference_bags() if arguments.all else arguments.bags:
        print_stderr(f"replaying {bag} ...")
        with working("comparing with the record"):
            done.append(_one(bag, arguments))
    vehicle_s, wall_s = sum(one.vehicle_s for one in done), sum(one.wall_s for one in done)
    factor = round(vehicle_s / wall_s, 1) if wall_s else 0.0
    document = {"bags": [one.document() for one in done], "times_real_time": factor}
    print_answer(document, lambda: _show(done, factor), as_json=arguments.json)
    differing = any(one.ledger.differences() for one in done)
    return 1 if differing and not arguments.update_refs else 0


def references() -> Path:
    """Folder of the references in this clone."""
    return clone_root() / "test" / "replay" / "references"


def _reference_bags() -> list[Path]:
    folder = clone_root() / "test" / "replay" / "bags"
    bags = sorted(one for one in folder.iterdir() if one.is_dir()) if folder.is_dir() else []
    if not bags:
        raise UsageError(f"{folder}: found no reference bags; --all works in a clone of the repository")
    return bags


def _one(bag: Path, arguments: argparse.Namespace) -> Replayed:
    if arguments.ros:
        rules = load_rules(arguments.tolerances, "ros")
        return replay_ros(bag, rules, arguments.vehicle, arguments.out)
    vehicle = load_vehicle(arguments.vehicle) if arguments.vehicle else None
    vehicle = vehicle or attached_vehicle(bag, attachments(bag))
    names = {} if arguments.all else names_of(bag, arguments.remap, vehicle)
    rules = load_rules(arguments.tolerances, "reference" if arguments.all else "pure")
    replayed = replay_bag(bag, rules, vehicle, results=arguments.all, names=names)
    if not replayed.ledger.messages and not replayed.ledger.differences():
        raise UsageError(
            f"{bag}: contains nothing to compare, neither wire frames with readings nor inertial samples with"
            f" navigation; `./hindrax bag info {bag}` lists its topics"
        )
    if arguments.all:
        file = reference_file(bag, references())
        if arguments.update_refs:
            _update(replayed, file)
        else:
            check_reference(replayed, file)
    return replayed


def _update(replayed: Replayed, file: Path) -> None:
    """Print what changed in a reference, for the commit message, and rewrite it; one that is met keeps its digits."""
    if file.exists():
        ledger = ComparisonReport(replayed.ledger.rules)
        changes = Replayed(replayed.bag, ledger, replayed.begin, samples=replayed.samples)
        check_reference(changes, file)
        found = changes.ledger.differences()
        print_stderr(f"{file.name}: {len(found)} fields changed")
        for one in found:
            print_stderr(f"  {one.sentence(replayed.begin)}")
        if not found:
            return
    write_reference(replayed, file)


def _show(done: list[Replayed], factor: float) -> None:
    for one in done:
        found = one.ledger.differences()
        verdict = f"{len(found)} fields differ" if found else "no difference"
        print_fitted(f"{one.bag}: {one.ledger.fields_compared} fields compared, {verdict}")
        for sentence in one.ledger.explanations():
            print_fitted(f"  {sentence}")
        for difference in found[:SHOWN]:
            print_fitted(f"  {difference.sentence(one.begin)}")
        if len(found) > SHOWN:
            print_fitted(f"  and {len(found) - SHOWN} more; --json lists them")
    print_fitted(f"replayed at {factor:.0f} times real time")
