"""A clone with the real scripts, on a machine whose interpreter, installer and builder are stand-ins."""

import os
import shutil
import signal
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[1]

LINKS = ("ros_ws/src", "firmware/hindrax_mcu")

# Plays an interpreter, and with it venv, pip, uv and colcon, and writes each step to $CALLS. In the step named by
# $DIE_IN it does half of the work and then takes the whole process group with it; in the step named by $FAIL_IN it
# fails with $COMPLAINT.
STAND_IN = r"""#!/bin/bash
set -eu
last=${*: -1}
begin() {
  echo "$1" >>"$CALLS"
  if [ "${FAIL_IN-}" = "$1" ]; then echo "${COMPLAINT-}"; exit 1; fi
}
half_done() { if [ "${DIE_IN-}" = "$1" ]; then kill -KILL 0; fi; }
play() { mkdir -p "$1/bin"; cp "$0" "$1/bin/$2"; }

case "$(basename "$0") $*" in
  python*' -I -')
    echo "${VERSION:-3.11} ${HEADERS:-true} ${ENSUREPIP:-true} $(readlink -f "$0")" ;;
  python*' -I -c '*) ;;
  python*' -I -B - '*)
    echo "answered without a set-up: ${*:5}" ;;
  python*'/setup/vehicle_lock.py '*)
    echo "of-a-vehicle==1" ;;
  python*' -m venv '*)
    begin venv; mkdir -p "$last"; echo half >"$last/half"; half_done venv; rm "$last/half"; play "$last" python ;;
  python*' -m pip install '*)
    begin pip; half_done pip; play "$(dirname "$(dirname "$0")")" uv ;;
  python*' -m pip config list')
    echo "global.index-url='https://mirror.invalid/simple'" ;;
  'uv venv '*)
    begin uv-venv; mkdir -p "$last"; echo half >"$last/half"; half_done uv-venv; rm "$last/half"; play "$last" python ;;
  'uv pip install '*)
    begin install; echo "index ${UV_DEFAULT_INDEX-}" "$*" >>"$CALLS.details"
    env=$(dirname "$(dirname "$(sed 's/.*--python \([^ ]*\) .*/\1/' <<<"$*")")")
    echo half >"$env/half"; half_done install; rm -f "$env/half"
    echo installed >"$env/rclpy"; play "$env" colcon ;;
  'colcon build '*)
    # Before it says that it begins: a test may interrupt it at once.
    trap '[ -z "${pause-}" ] || kill $pause; exit 1' INT
    begin colcon; mkdir -p build install; echo half >build/half; half_done colcon
    case "$*" in
      *--packages-skip*) echo kept >>"$CALLS.details"; [ -d install/hindrax_msgs ] ;;
      *) mkdir -p install/hindrax_msgs; echo "prefix $(dirname "$PWD")/ros_ws" >install/hindrax_msgs/prefix.sh ;;
    esac
    sleep "${BUILD_S:-0}" & pause=$!; wait $pause
    rm build/half; echo 'export ROS_DISTRO=jazzy PYTHONPATH=/from/the/workspace' >install/local_setup.bash ;;
  python*' -c import '*)
    begin try; [ -e "$(dirname "$(dirname "$0")")/rclpy" ] ;;
  python*' -m compileall '*)
    begin compile ;;
  python*' -P -m hindrax_cli'*)
    # Until the tool hears it.
    kill -INT $$
    echo "the tool got: ${*:4}; ROS is $ROS_DISTRO, discovery $ROS_AUTOMATIC_DISCOVERY_RANGE" ;;
  *)
    echo "the stand-in knows no: $0 $*" >&2; exit 99 ;;
esac
"""


@dataclass
class Clone:
    root: Path
    tools: Path
    calls: Path
    environment: dict[str, str] = field(default_factory=dict)

    def start(self, *arguments: str, **environment: str) -> subprocess.Popen[str]:
        """Start ./hindrax as the head of a process group of its own, which hears SIGINT even if this run does not."""
        return subprocess.Popen(
            [self.root / "hindrax", *arguments],
            env=self.environment | environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # noqa: PLW1509  # a plain call, no threads
        )

    def run(self, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
        process = self.start(*arguments, **environment)
        try:
            out, err = process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            raise
        return subprocess.CompletedProcess(process.args, process.returncode, out, err)

    def steps(self) -> list[str]:
        """Steps since the last question."""
        made = self.calls.read_text(encoding="utf-8").split() if self.calls.exists() else []
        self.calls.unlink(missing_ok=True)
        return made

    def tool(self, name: str, script: str) -> None:
        """Put a program before those of the machine."""
        path = self.tools / name
        path.write_text(script, encoding="utf-8")
        path.chmod(0o755)

    def edit(self, name: str, line: str = "# an edit") -> None:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a", encoding="utf-8") as file:
            file.write(line + "\n")


def copy_clone(destination: Path) -> None:
    shutil.copytree(ROOT / "setup", destination / "setup")
    shutil.copytree(ROOT / ".ci", destination / ".ci")
    shutil.copy(ROOT / "hindrax", destination)
    for name in ("hindrax_msgs/package.xml", "hindrax_msgs/msg/Heartbeat.msg", "hindrax_bringup/setup.cfg"):
        (destination / "src" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "src" / name, destination / "src" / name)
    (destination / "src/hindrax_sim/hindrax_sim/firmware").mkdir(parents=True)
    for link in LINKS:
        (destination / link).parent.mkdir(parents=True, exist_ok=True)
        (destination / link).symlink_to((ROOT / link).readlink())
