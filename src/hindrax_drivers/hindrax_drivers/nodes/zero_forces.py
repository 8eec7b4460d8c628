"""Zeros in the place of a node `thrusters` that has died, for an output whose neutral is a message of ROS.

The dead man has no ROS and must not wait for it, so this process stands by, connected: each byte on its standard
input is one message of zeros. When the input ends, because the dead man ends or has died, it sends them once more,
as soon as somebody listens, and ends: 0 when somebody did. After a standstill it begins anew in the same process: the
middleware may have lost who listens, and would say that somebody does (ADR 13).
"""

import contextlib
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Sequence

from hindrax_drivers.nodes.thruster_settings import Settings
from hindrax_ros.standstill import LOOK_S as NOTICED_S
from hindrax_ros.standstill import StandstillWatch

LISTENER_S = 3.0
"""Time for the discovery of whoever listens."""
SPREAD_S = 0.2
"""Time for the last message to leave this process."""
LOOK_S = 0.02
ENDED_S = LISTENER_S + SPREAD_S + 3.0
"""With the start of ROS, which may have just begun."""


def _words(arguments: Sequence[str]) -> list[str]:
    return [sys.executable, "-m", "hindrax_drivers.nodes.zero_forces", *arguments]


class ZeroForces:
    """The process that stands by, started again when it has died."""

    def __init__(self, arguments: Sequence[str]) -> None:
        self._arguments = tuple(arguments)
        self._process: subprocess.Popen[bytes] | None = None

    def send(self) -> None:
        """Have zeros sent, without waiting for it."""
        if self._process is None or self._process.poll() is not None:
            # A session of its own: no signal to the group of the dead man reaches it.
            self._process = subprocess.Popen(_words(self._arguments), stdin=subprocess.PIPE, start_new_session=True)  # noqa: S603  # ours
            assert self._process.stdin is not None
            os.set_blocking(self._process.stdin.fileno(), False)
        assert self._process.stdin is not None
        with contextlib.suppress(BlockingIOError, BrokenPipeError):  # it has enough to do, or the next one does it
            os.write(self._process.stdin.fileno(), b"0")

    def close(self) -> str:
        """Let it send the last zeros and end; returns the trouble, empty when somebody heard them."""
        if self._process is None or self._process.stdin is None:
            return ""
        self._process.stdin.close()
        try:
            code = self._process.wait(ENDED_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        return "" if code == 0 else "nobody listens to the forces"


def stands_by(source: int, stood_still_s: Callable[[], float], send: Callable[[], None]) -> bool:
    """Send once for whatever comes in, until the input ends or this process has stood still.

    Parameters
    ----------
    source
        Descriptor of the input.
    stood_still_s
        As of `StandstillWatch`.
    send
        Sends the zeros.

    Returns
    -------
    bool
        Whether the input goes on: what has come meanwhile is still in it.
    """
    while not stood_still_s():
        # Who has just continued reads no faster than the watch looks.
        if select.select([source], [], [], NOTICED_S)[0]:
            if not os.read(source, 4096):
                return False
            send()
    return True


def main(arguments: Sequence[str], settings: Settings) -> int:
    """Stand by until the input ends."""
    import rclpy  # noqa: PLC0415  # the dead man, which has the class above, does without
    from rclpy.node import Node  # noqa: PLC0415
    from rclpy.signals import SignalHandlerOptions  # noqa: PLC0415

    from hindrax_drivers.nodes.force_topics import ForcePublishers  # noqa: PLC0415
    from hindrax_ros.process import scoped  # noqa: PLC0415

    rclpy.init(args=scoped(["thrusters", *arguments], "thrusters"), signal_handler_options=SignalHandlerOptions.NO)
    node = Node("thrusters_dead_man", enable_rosout=False, start_parameter_services=False)
    topics, zeros = ForcePublishers(node, settings.vehicle, settings.port), [0.0] * len(settings.vehicle.thrusters)
    watch = StandstillWatch()
    if stands_by(sys.stdin.fileno(), watch.stood_still_s, lambda: topics.send(zeros)):
        os.execv(sys.executable, _words(arguments))  # noqa: S606  # ours: another participant, the same pipe
    end_s = time.monotonic() + LISTENER_S
    while topics.unheard() and time.monotonic() < end_s:
        time.sleep(LOOK_S)
    heard = not topics.unheard()
    topics.send(zeros)
    time.sleep(SPREAD_S)
    rclpy.shutdown()
    return int(not heard)


if __name__ == "__main__":
    from hindrax_drivers.nodes.thruster_settings import read_settings

    sys.exit(main(sys.argv[1:], read_settings(sys.argv[1:])))
