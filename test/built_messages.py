"""Messages that are in no wheel of ROS, built as set-up builds the message of /tf."""

import ctypes
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest
from documentation.pages import ROOT

from hindrax_ros.messages.serialization import message_class

LIKE = ROOT / "setup" / "tf2_msgs"


def built_messages(folder: Path, package: str, name: str, definition: str, *needs: str) -> dict[str, str]:
    """Build one message of a package into a folder; returns the environment in which it is found."""
    lines = {file: (LIKE / file).read_text(encoding="utf-8") for file in ("CMakeLists.txt", "package.xml")}
    for file, text in lines.items():
        made = text.replace("tf2_msgs", package).replace("TFMessage", name)
        (folder / file).write_text(_with_needs(made, needs), encoding="utf-8")
    (folder / "msg").mkdir()
    (folder / "msg" / f"{name}.msg").write_text(definition, encoding="utf-8")
    install = folder / "install"
    for words in (
        ["-S", str(folder), "-B", str(folder / "build"), f"-DCMAKE_INSTALL_PREFIX={install}", "-DBUILD_TESTING=OFF"],
        ["--build", str(folder / "build"), "--target", "install"],
    ):
        done = subprocess.run(["cmake", *words], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    (modules,) = install.glob("lib/python*/site-packages")
    first = {"AMENT_PREFIX_PATH": install, "LD_LIBRARY_PATH": install / "lib", "PYTHONPATH": modules}
    return {key: os.pathsep.join(filter(None, [str(path), os.environ.get(key)])) for key, path in first.items()}


def _with_needs(text: str, needs: Sequence[str]) -> str:
    """Each line that names the one package which the message of /tf needs, for each of these."""
    made = []
    for line in text.splitlines():
        if "DEPENDENCIES geometry_msgs" in line:
            made.append(line.replace("geometry_msgs", " ".join(needs)))
        elif "geometry_msgs" in line:
            made += [line.replace("geometry_msgs", one) for one in needs]
        else:
            made.append(line)
    return "\n".join(made) + "\n"


@contextmanager
def loaded_here(environment: Mapping[str, str], package: str) -> Iterator[None]:
    """Let this process import them until the end: the loader has read its search path before they were built."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in environment.items():
            patch.setenv(name, value)
        patch.syspath_prepend(environment["PYTHONPATH"].partition(os.pathsep)[0])
        waiting = sorted(Path(environment["LD_LIBRARY_PATH"].partition(os.pathsep)[0]).glob("*.so"))
        while waiting:
            waiting, before = [library for library in waiting if not _loaded(library)], len(waiting)
            assert len(waiting) < before, f"libraries that need others: {waiting}"
        yield
    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        del sys.modules[name]
    message_class.cache_clear()


def _loaded(library: Path) -> bool:
    try:
        ctypes.CDLL(str(library), ctypes.RTLD_GLOBAL)
    except OSError:  # one that it needs comes first
        return False
    return True
