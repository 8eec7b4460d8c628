"""What `up` does before its processes start."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from hindrax_bag.bag_index import is_whole
from hindrax_bag.read.bag_reader import messages
from hindrax_bag.write.bag_writer import BagWriter, Channel
from hindrax_bag.write.limits import BagLimits
from hindrax_bringup.stack_runner import complete_earlier

WORD = Channel("/demo/word", "demo_msgs/msg/Word")


def test_bags_of_earlier_runs_are_completed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bag = BagWriter(tmp_path / "now" / "bag", lambda _package, _name: "uint8 one\n", BagLimits(keep_free_MB=0.0))
    bag.open()
    bag.write(WORD, b"\x00\x01\x00\x00\x07", 1, 1)
    bag.flush()
    # What a power cut leaves: the same bytes, and no recorder that has them open.
    cut = tmp_path / "before" / "bag"
    shutil.copytree(bag.folder, cut)
    working = complete_earlier(tmp_path)
    assert working is not None
    assert working.wait() == 0
    assert str(cut) in capsys.readouterr().err
    assert is_whole(cut / "bag_0.mcap")
    assert (cut / "metadata.yaml").exists()
    assert [one.decoded().one for one in messages(cut)] == [7]
    assert not is_whole(bag.path)
    bag.close()
    assert complete_earlier(tmp_path) is None
