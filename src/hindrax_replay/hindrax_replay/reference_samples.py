"""References of replays: what our own code made of a bag the last time they were reviewed.

A reference is no golden number. It is written only when asked for (`--update-refs`), beside a report of what changed.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hindrax_bag.message_comparison import ComparisonReport
from hindrax_core.errors import UsageError
from hindrax_replay.bag_replay import Replayed

Samples = Mapping[str, Mapping[str, Mapping[str, Any]]]
PREFIX = "reference "
"""Topics of a reference appear in reports and in the file of tolerances with this before their name."""


def reference_file(bag: Path, folder: Path) -> Path:
    """Where the reference of a bag lies."""
    return folder / f"{bag.name}.json"


def check_reference(replayed: Replayed, file: Path) -> None:
    """Compare the samples of a replay with its reference; UsageError when that cannot be read."""
    try:
        expected: Samples = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UsageError(f"{file}: cannot be read as a reference ({error}); --update-refs writes one") from error
    compare_samples(replayed.ledger, expected, replayed.samples, replayed.begin)


def compare_samples(ledger: ComparisonReport, expected: Samples, found: Samples, begin: int) -> None:
    """Compare two sets of samples, topic by topic and sample by sample."""
    for topic in expected.keys() | found.keys():
        there, here = expected.get(topic, {}), found.get(topic, {})
        for key in there.keys() | here.keys():
            stamp = int(key) if key.isdigit() else begin
            if key in there and key in here:
                ledger.compare_values(PREFIX + topic, stamp, there[key], _as_read(here[key]))
            elif key in there:
                ledger.unmatched(PREFIX + topic, stamp, "in the reference, not replayed", key, "none")
            else:
                ledger.unmatched(PREFIX + topic, stamp, "replayed, not in the reference", "none", key)


def write_reference(replayed: Replayed, file: Path) -> None:
    """Write the samples of a replay as the reference from now on, a line for each."""
    topics = []
    for topic, samples in sorted(replayed.samples.items()):
        lines = [f"  {json.dumps(key)}: {json.dumps(_as_read(values))}" for key, values in samples.items()]
        topics.append(f"{json.dumps(topic)}: {{\n" + ",\n".join(lines) + "\n}")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("{\n" + ",\n".join(topics) + "\n}\n", encoding="utf-8")


def _as_read(values: Mapping[str, Any]) -> dict[str, Any]:
    """Bytes have no JSON; everything else comes back as it was."""
    return {name: value.hex() if isinstance(value, bytes) else value for name, value in values.items()}
