"""Records are analyzed where nothing of ROS is, not even behind several imports."""

import math
import subprocess
import sys
from pathlib import Path

SOURCES = Path(__file__).parents[2]
PURE = ("core", "control", "ident", "bag", "analysis")
SCRIPT = """
import sys

class NoRos:
    def find_spec(self, name, path=None, target=None):
        root = name.partition(".")[0]
        ros = ("rclpy", "hindrax_ros", "rosidl_runtime_py", "ament_index_python")
        if root in ros or root.endswith(("_msgs", "_interfaces")):
            raise ModuleNotFoundError(f"{name} is ROS", name=name)

sys.meta_path.insert(0, NoRos())
from hindrax_analysis import api
found = api.identify(sys.argv[1], vehicle=api.load_vehicle(sys.argv[2]), motions=["surge"])
print(found.motions["surge"].coefficients["k_q"].value)
"""
TRUE_KQ, MASS_kg = 45.0, 25.0


def record(path: Path) -> Path:
    """Surge of a hull with mass and quadratic drag alone, stepped by Euler at 20 Hz."""
    rows, u = ["t,u,X"], 0.0
    for step in range(2400):
        t = 0.05 * step
        X = 20.0 * math.sin(0.4 * t) + 12.0 * math.sin(1.1 * t + 1.0)
        rows.append(f"{t:.2f},{u:.6f},{X:.4f}")
        for _ in range(10):
            u += 0.005 * (X - TRUE_KQ * abs(u) * u) / MASS_kg
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def hull(path: Path) -> Path:
    path.write_text(
        f"name: hull\nmass_kg: {MASS_kg}\nvolume_m3: 0.025\nenvelope_m: [0.5, 0.4, 0.3]\n", encoding="utf-8"
    )
    return path


def test_a_csv_is_identified_where_no_ros_can_be_imported(tmp_path: Path) -> None:
    paths = [str(SOURCES / f"hindrax_{name}") for name in PURE]
    script = f"import sys; sys.path[:0] = {paths!r}\n{SCRIPT}"
    words = [sys.executable, "-c", script, str(record(tmp_path / "surge.csv")), str(hull(tmp_path / "hull.yaml"))]
    done = subprocess.run(words, capture_output=True, text=True, check=False, env={"PATH": ""})
    assert done.returncode == 0, done.stderr
    assert abs(float(done.stdout) - TRUE_KQ) < 0.05 * TRUE_KQ
