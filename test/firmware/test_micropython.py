"""The same rules in a real MicroPython, where node and the interpreter's npm package are at hand."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
PACKAGE = Path(os.environ.get("HINDRAX_MICROPYTHON", ROOT / ".hindrax/micropython/package"))
NODE = shutil.which("node")


@pytest.mark.skipif(
    NODE is None or not (PACKAGE / "micropython.mjs").exists(),
    reason="needs node, and @micropython/micropython-webassembly-pyscript unpacked (HINDRAX_MICROPYTHON)",
)
def test_rules_hold_in_micropython() -> None:
    command = [
        str(NODE),
        str(HERE / "micropython.mjs"),
        str(PACKAGE),
        str(ROOT / "firmware"),
        str(HERE / "test_rules.py"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, (done.stdout + done.stderr)[-1500:]
    assert "passed 14 on micropython" in done.stdout
