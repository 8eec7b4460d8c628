"""Zeros in the place of a node `thrusters` that has died, for an output whose neutral is a message of ROS.

The dead man has no ROS and must not wait for it, so this process stands by, connected: each byte on its standard
input is one message of zeros. When the input ends, because the dead man ends or has died, it sends them once more,
as soon as somebody listens, and ends: 0 when somebody did.
"""

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Sequence

from hindrax_drivers.nodes.thruster_settings import Settings

LISTENER_S = 3.0
"""Time for the discovery of whoever listens."""
SPREAD_S = 0.2
"""Time for the last message to leave this process."""
LOOK_S = 0.02
ENDED_S = LISTENER_S + SPREAD_S + 3.0
"""With the start of ROS, which may have just begun."""


class ZeroForces:
    """The process that stands by, started again when it has died."""

    def __init__(self, arguments: Sequence[str]) -> None:
        self._arguments = tuple(arguments)
        self._process: subprocess.Popen[bytes] | None = None

    def send(self) -> None:
        """Have zeros sent, without waiting for it."""
        if self._process is None or self._process.poll() is not None:
            words = [sys.executable, "-m", "hindrax_drivers.nodes.zero_forces", *self._arguments]
            # A session of its own: no signal to the group of the dead man reaches it.
            self._process = subprocess.Popen(words, stdin=subprocess.PIPE, start_new_session=True)  # noqa: S603  # ours
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
    while os.read(sys.stdin.fileno(), 4096):
        topics.send(zeros)
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
