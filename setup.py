"""The wheel `hindrax`: what of these packages needs no ROS, for `pip install`. colcon never reads this file.

Packages, modules and dependencies are those of `src/*`: which Python packages a package needs stands once, in its
package.xml, by its rosdep key or, where rosdep has none, as `pip_depend` in the exports.
"""

import xml.etree.ElementTree as ET
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.build_py import build_py

ROOT = Path(__file__).parent
COLLECTED = (
    "hindrax_core", "hindrax_control", "hindrax_ident", "hindrax_bag", "hindrax_analysis", "hindrax_laboratory",
    "hindrax_bringup", "hindrax_cli",
)  # fmt: skip
PARTS = {
    "hindrax_bringup": {"__init__", "share_files"},
    "hindrax_cli.health_checks": {"__init__"},
    "hindrax_cli.commands.pool": {"__init__", "report_export"},
    "hindrax_cli.commands.machine": {"__init__", "vehicle"},
    "hindrax_cli.commands.data": {"__init__", "bag", "identify", "predict"},
    "hindrax_cli.commands.experiment": {"__init__", "blocks", "drag", "oscillation"},
    "hindrax_cli.commands.explain": {"__init__", "allocate", "benchmark", "papers"},
}
"""Packages of which only these modules work without ROS."""
LEFT_OUT = {
    "hindrax_bringup.network", "hindrax_cli.commands.operate", "hindrax_cli.deployment",
    "hindrax_cli.pool_plan",
}  # fmt: skip
"""Packages and modules that need ROS, or a stack."""
ROS_ONLY = {"segno"}
"""Python packages that only what is left out needs: addresses of the page for a phone."""
OTHER_NAMES = {"yaml": "pyyaml"}
LEAST = {"numpy": "numpy>=1.26"}


def packages_of(name: str) -> list[str]:
    """Packages of one ROS package that go into the wheel."""
    found = find_packages(str(ROOT / "src" / name), include=[f"{name}*"])
    return [one for one in found if ".nodes" not in one and one not in LEFT_OUT]


def requirements() -> list[str]:
    """Python packages that the collected packages declare; keys of ROS and of each other are none."""
    found = set()
    for name in COLLECTED:
        manifest = ET.parse(ROOT / "src" / name / "package.xml").getroot()
        keys = (one.text or "" for one in manifest.findall("exec_depend"))
        found |= {key.removeprefix("python3-") for key in keys if key.startswith("python3-")}
        found |= {one.text or "" for one in manifest.findall("export/pip_depend")}
    return sorted(LEAST.get(name, OTHER_NAMES.get(name, name)) for name in found - ROS_ONLY)


class WithoutRos(build_py):
    """Takes only the modules of `PARTS`, and the vehicles that come with the stack."""

    def find_package_modules(self, package: str, package_dir: str) -> list[tuple[str, str, str]]:
        """Modules of one package."""
        found: list[tuple[str, str, str]] = super().find_package_modules(package, package_dir)
        kept = [one for one in found if package not in PARTS or one[1] in PARTS[package]]
        return [one for one in kept if f"{package}.{one[1]}" not in LEFT_OUT]

    def run(self) -> None:
        """Build, with the files that ROS would install into the share folder."""
        super().run()
        for folder in ("vehicles", "config"):
            target = Path(self.build_lib) / "hindrax_bringup" / folder
            self.mkpath(str(target))
            for file in sorted((ROOT / "src/hindrax_bringup" / folder).glob("*.yaml")):
                self.copy_file(str(file), str(target / file.name))


setup(
    packages=[package for name in COLLECTED for package in packages_of(name)],
    package_dir={
        package: f"src/{name}/{package.replace('.', '/')}" for name in COLLECTED for package in packages_of(name)
    },
    package_data={"": ["py.typed", "*.css", "*.yaml"]},
    include_package_data=False,
    install_requires=requirements(),
    cmdclass={"build_py": WithoutRos},
)
