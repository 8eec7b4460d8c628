"""What shows the vehicle needs neither ROS nor messages: it names their types only."""

import subprocess
import sys

SHOWN = "hindrax_operator.operator_view, hindrax_operator.snapshot, hindrax_operator.progress"


def test_views_load_no_ros() -> None:
    words = f"import sys, {SHOWN}; print(*(set(sys.modules) & {{'rclpy', 'hindrax_msgs', 'diagnostic_msgs'}}))"
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
