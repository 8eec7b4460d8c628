"""What is on the path of a package's tests in a copy of src alone, and what is not."""

import os
from pathlib import Path

import pytest

from hindrax_bringup.clone import clone_root
from hindrax_core.errors import UsageError
from hindrax_tools.bare_sources import copy_of_sources, environment_of, packages_up_to


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    """Three packages: one of tests needs another than the package does, and what that tests with is not needed."""
    needs = {
        "hindrax_a": "",
        "hindrax_b": "<exec_depend>hindrax_a</exec_depend><test_depend>hindrax_d</test_depend>",
        "hindrax_c": "<exec_depend>rclpy</exec_depend><test_depend>hindrax_b</test_depend>",
        "hindrax_d": "",
    }
    for name, lines in needs.items():
        (tmp_path / "src" / name).mkdir(parents=True)
        (tmp_path / "src" / name / "package.xml").write_text(f"<package>{lines}</package>")
    return tmp_path / "src"


def test_up_to_a_package_is_what_it_and_its_tests_declare_and_what_those_need(sources: Path) -> None:
    assert packages_up_to(sources, "hindrax_c") == {"hindrax_a", "hindrax_b", "hindrax_c"}
    assert packages_up_to(sources, "hindrax_b") == {"hindrax_a", "hindrax_b", "hindrax_d"}
    with pytest.raises(UsageError, match=r"package hindrax_e: found none in .* wanted one of hindrax_a, hindrax_b"):
        packages_up_to(sources, "hindrax_e")


def test_nothing_else_of_ours_is_found(sources: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built = ("/ws/build/hindrax_b", "/ws/install/hindrax_msgs/lib", "/ws/install/tf2_msgs/lib", "/opt/ros/lib")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([*built, str(clone_root() / "tools"), ""]))
    monkeypatch.setenv("HINDRAX_ROOT", "/ws")
    made = environment_of(sources, "hindrax_c")
    wanted = [*(str(sources / f"hindrax_{one}") for one in "abc"), "/ws/install/tf2_msgs/lib", "/opt/ros/lib"]
    assert made["PYTHONPATH"].split(os.pathsep) == wanted
    assert "HINDRAX_ROOT" not in made


def test_a_copy_has_no_caches_and_its_links_lead_nowhere_else(sources: Path, tmp_path: Path) -> None:
    (sources / "hindrax_a/__pycache__").mkdir()
    (sources / "hindrax_a/firmware").symlink_to("../../firmware")
    copy = copy_of_sources(sources, tmp_path / "copy")
    assert sorted(file.name for file in (copy / "hindrax_a").iterdir()) == ["firmware", "package.xml"]
    assert not (copy / "hindrax_a/firmware").exists()
