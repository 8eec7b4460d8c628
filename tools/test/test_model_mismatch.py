"""What obeys another law is not known with confidence."""

import numpy as np
import pytest

from hindrax_tools.uncertainty.model_mismatch import AXES, LAWS, VEHICLES, MotionVerdict, fly, judged


def test_the_truth_of_a_record_without_another_law_is_its_steady_speed() -> None:
    axis = VEHICLES[1][1]["surge"]
    plain = next(law for law in LAWS if law.name == "weak reverse")
    t, v, reported = fly(axis, plain, np.random.default_rng(0))
    ends = np.flatnonzero(np.diff(reported, append=np.nan) != 0.0)
    ahead = next(index for index in ends.tolist() if reported[index] > 0.8 * axis.pull)
    assert axis.drag(float(np.mean(v[ahead - 8 : ahead]))) == pytest.approx(reported[ahead], rel=0.05)
    assert t[1] - t[0] == pytest.approx(0.1)


def test_a_rope_on_the_floor_is_not_taken_for_drag_with_confidence() -> None:
    law = next(index for index, one in enumerate(LAWS) if one.name == "rope on the floor")
    found = judged(0, law, 0.02)
    assert {one.motion.partition("_")[0] for one in found} == set(AXES)
    assert not any(one.confidently_wrong for one in found)


def test_wrong_is_more_than_three_deviations_without_a_word() -> None:
    off = MotionVerdict("surge", (0.0, 1.0, -3.1), 0.0, identified=True, named=())
    assert off.confidently_wrong
    assert not MotionVerdict("surge", (0.0, 1.0, -3.1), 0.0, identified=True, named=("tether",)).confidently_wrong
    assert not MotionVerdict("surge", (0.0, 1.0, -2.9), np.nan, identified=True, named=()).confidently_wrong
    assert MotionVerdict("surge", (0.0, 1.0, 0.0), 3.2, identified=True, named=()).confidently_wrong
