"""What a bag may take of the disk: where a file ends, where a bag ends, and where none begins."""

from pathlib import Path

import pytest

from hindrax_bag.write import limits
from hindrax_bag.write.limits import BagLimits
from hindrax_core.errors import HindraxError


@pytest.mark.parametrize(
    ("given", "wanted_MB", "plan"),
    [
        (BagLimits(keep_free_MB=50.0, planned_s=100.0), 60, "10 MB for 100 s of recording"),
        (BagLimits(keep_free_MB=50.0), 50, "a start"),
        (BagLimits(keep_free_MB=50.0, planned_s=100.0, budget_MB=4.0), 60, "10 MB for 100 s of recording"),
        (BagLimits(keep_free_MB=50.0, planned_s=100.0, budget_MB=4.0, when_full="oldest"), 54, "4 MB for 100 s"),
        (BagLimits(keep_free_MB=50.0, planned_s=100.0, when_full="oldest"), 60, "10 MB for 100 s of recording"),
    ],
)
def test_a_run_begins_where_it_fits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, given: BagLimits, wanted_MB: int, plan: str
) -> None:
    monkeypatch.setattr(limits, "free_bytes", lambda _folder: wanted_MB * 1_000_000)
    given.check_space(tmp_path)
    monkeypatch.setattr(limits, "free_bytes", lambda _folder: wanted_MB * 1_000_000 - 600_000)
    with pytest.raises(HindraxError) as refused:
        given.check_space(tmp_path)
    assert f"{wanted_MB - 1} MB are free, {wanted_MB} MB are wanted ({plan}" in str(refused.value)
    assert "and 50 MB stay free); make room" in str(refused.value)


@pytest.mark.parametrize(
    ("given", "size_MB", "age_s", "due"),
    [
        (BagLimits(split_MB=10.0, split_s=60.0), 9.9, 59.0, False),
        (BagLimits(split_MB=10.0, split_s=60.0), 10.0, 0.0, True),
        (BagLimits(split_MB=10.0, split_s=60.0), 0.0, 60.0, True),
        (BagLimits(split_MB=0.0, split_s=0.0), 1e6, 1e6, False),
        (BagLimits(split_MB=10.0, budget_MB=8.0), 3.0, 0.0, False),
        (BagLimits(split_MB=10.0, budget_MB=8.0, when_full="oldest"), 1.9, 0.0, False),
        (BagLimits(split_MB=10.0, budget_MB=8.0, when_full="oldest"), 2.0, 0.0, True),
        (BagLimits(split_MB=0.0, budget_MB=8.0, when_full="oldest"), 2.0, 0.0, True),
        (BagLimits(split_MB=1.0, budget_MB=8.0, when_full="oldest"), 1.0, 0.0, True),
    ],
)
def test_a_file_ends_by_size_by_time_or_as_a_quarter_of_a_budget_from_which_the_oldest_goes(
    given: BagLimits, size_MB: float, age_s: float, due: bool
) -> None:
    assert given.split_due(round(size_MB * 1e6), age_s) is due


def test_a_bag_may_fill_its_budget_and_one_without_has_no_end() -> None:
    assert not BagLimits(budget_MB=3.0).over_budget(3_000_000)
    assert BagLimits(budget_MB=3.0).over_budget(3_000_001)
    assert not BagLimits().over_budget(10**15)
