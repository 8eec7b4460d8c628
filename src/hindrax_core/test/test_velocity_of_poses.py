"""Velocities of poses: mean over an interval, in body axes, and nothing of what is no pose."""

import contextlib
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import pytest

from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.hydrostatics import Water
from hindrax_core.messages.inputs import INPUTS, InputKnobs
from hindrax_core.messages.velocity_of_poses import LEAST_S, Pose, VelocityOfPoses
from hindrax_core.readings import BottomVelocity, Reading
from hindrax_core.rotation import xyzw_from_sname

SIGMA_m = 0.003


def pose(t: float, *, turning: float = 0.3, speed: float = 0.4) -> Pose:
    """A vehicle that goes ahead on a circle; east, north, up."""
    heading = turning * t
    east, north = speed / turning * (1.0 - math.cos(heading)), speed / turning * math.sin(heading)
    return Pose((east, north, -1.0 - 0.1 * t), xyzw_from_sname(0.0, 0.0, heading), SIGMA_m)


def read(poses: Sequence[tuple[float, Pose]]) -> list[Stamped[Reading]]:
    """What is read of poses at these times, one after the other."""
    at: Iterator[Stamped[Reading]] = iter([Stamped(stamp_from_s(t), one) for t, one in poses])
    reader = VelocityOfPoses(lambda _: next(at))
    return [reader(b"") for _ in poses]


def velocities(poses: Sequence[tuple[float, Pose]]) -> list[Stamped[BottomVelocity]]:
    found = [(one.stamp, one.reading) for one in read(poses)]
    return [Stamped(stamp, reading) for stamp, reading in found if isinstance(reading, BottomVelocity)]


@pytest.mark.parametrize("rate_Hz", [5.0, 30.0, 120.0])
def test_a_velocity_is_the_mean_over_its_interval_and_in_body_axes(rate_Hz: float) -> None:
    found = velocities([(n / rate_Hz, pose(n / rate_Hz)) for n in range(round(4 * rate_Hz))])
    assert len(found) >= 3.7 / 0.22
    for one in found:
        assert one.reading.velocity_mps == pytest.approx((0.4, 0.0, 0.1), abs=1e-3)
        assert one.reading.sigma_mps == pytest.approx(math.sqrt(2.0) * SIGMA_m / one.reading.interval_s)
        assert 0.19 <= one.reading.interval_s < 0.25
    first = found[0]
    assert first.stamp == pytest.approx(0.5e9 * first.reading.interval_s, abs=2.0), "the middle of its interval"
    for before, after in itertools.pairwise(found):
        between_s = 1e-9 * (after.stamp - before.stamp)
        assert between_s == pytest.approx(0.5 * (before.reading.interval_s + after.reading.interval_s), abs=1e-8)


def test_both_signs_of_a_quaternion_are_one_attitude() -> None:
    begin, end = pose(0.0), pose(0.2)
    x, y, z, w = end.attitude
    other = Pose(end.position_m, (-x, -y, -z, -w), SIGMA_m)
    (found,) = velocities([(0.0, begin), (0.2, other)])
    assert found.reading.velocity_mps == pytest.approx((0.4, 0.0, 0.1), abs=1e-3)


def test_after_a_gap_and_a_step_back_an_interval_begins_anew() -> None:
    with pytest.raises(ValueError, match=r"found 1\.00 s between poses, wanted at most 0\.7 s"):
        read([(0.0, pose(0.0)), (1.0, pose(1.0))])
    assert len(velocities([(5.0, pose(5.0)), (1.0, pose(1.0)), (1.2, pose(1.2))])) == 1
    assert velocities([(5.0, pose(5.0)), (5.0, pose(5.01)), (5.0 + 0.9 * LEAST_S, pose(5.1))]) == []


def test_what_a_tracker_repeats_is_not_seen() -> None:
    """Hidden from 0.1 s on, it sends the last pose: half of the way in the whole interval, and a leap after it."""
    poses = [(0.01 * n, pose(0.01 * (n if n < 10 or n > 40 else 10))) for n in range(70)]
    reader, found = VelocityOfPoses(lambda data: Stamped(stamp_from_s(poses[data[0]][0]), poses[data[0]][1])), []
    for n in range(70):
        with contextlib.suppress(ValueError):
            found.append(reader(bytes([n])).reading)
    speeds = [one.velocity_mps for one in found if isinstance(one, BottomVelocity)]
    assert len(speeds) == 2
    assert all(one == pytest.approx((0.4, 0.0, 0.1), abs=2e-3) for one in speeds)


NAN = math.nan


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (Pose((NAN, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0), SIGMA_m), "found a position of .*nan"),
        (Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0), SIGMA_m), "a quaternion of length 0, wanted 1"),
        (Pose((0.3, 0.0, 0.0), pose(0.0).attitude, SIGMA_m), "the same attitude twice, to the last digit"),
    ],
)
def test_what_is_no_pose_is_no_velocity(bad: Pose, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        read([(0.0, pose(0.0)), (0.2, bad)])


@pytest.mark.parametrize(("word", "covariance"), [("pose", (4e-4, *(0.0,) * 35)), ("pose_stamped", ())])
def test_poses_of_ros_have_their_own_deviation_or_that_of_the_parameter(
    word: str, covariance: tuple[float, ...]
) -> None:
    row = INPUTS["velocity"][word]
    made: Callable[..., Reading] = row.contents(Water(), InputKnobs(pose_sigma_m=SIGMA_m)).made
    found = made(1.0, 2.0, -0.5, 0.0, 0.0, 0.0, 1.0, *covariance)
    assert found == Pose((1.0, 2.0, -0.5), (0.0, 0.0, 0.0, 1.0), 0.02 if covariance else SIGMA_m)
    assert isinstance(row.together(partial(Stamped, stamp_from_s(0.0))), VelocityOfPoses)
