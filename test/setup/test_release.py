"""A release: what is not ready is refused before anything is built; what is built has checksums, and then its tag."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
HINDRAX = """#!/bin/sh
if [ "$1" = setup ]; then mkdir -p .hindrax/env/bin && cp python-of-the-tests .hindrax/env/bin/python; exit; fi
while [ "$1" != --out ]; do shift; done
mkdir -p "$2" && echo made > "$2/index.html"
"""
PYTHON = """#!/bin/sh
while [ "$1" != --dist-dir ]; do shift; done
echo wheel > "$2/hindrax-1.2.3-py3-none-any.whl"
"""


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A fresh clone of version 1.2.3 whose tools only pretend to set up and to build."""
    (tmp_path / "setup").mkdir()
    for name in ("release.sh", "version.sh"):
        shutil.copy(ROOT / "setup" / name, tmp_path / "setup")
    for name, text in (("python-of-the-tests", PYTHON), ("hindrax", HINDRAX)):
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    (tmp_path / "VERSION").write_text("1.2.3\n")
    (tmp_path / "CHANGELOG.md").write_text("# Changelog\n\n## 1.2.3 (2026-12-01)\n")
    (tmp_path / "CITATION.cff").write_text("version: 1.2.3\n")
    (tmp_path / ".gitignore").write_text("/.hindrax/\n/dist/\n")
    git(tmp_path, "init", "--quiet")
    commit(tmp_path)
    return tmp_path


def git(clone: Path, *words: str) -> str:
    who = ("-c", "user.name=a", "-c", "user.email=a@b.invalid")
    return subprocess.run(["git", *who, *words], cwd=clone, check=True, capture_output=True, text=True).stdout


def commit(clone: Path) -> None:
    git(clone, "add", "--all")
    git(clone, "commit", "--quiet", "--message", "x")


def release(clone: Path, *words: str) -> subprocess.CompletedProcess[str]:
    who = {f"GIT_{one}_{what}": "a@b.invalid" for one in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")}
    command = [str(clone / "setup/release.sh"), *words]
    return subprocess.run(command, env=os.environ | who, capture_output=True, text=True, check=False)


def test_what_is_built_has_checksums_and_then_its_tag(clone: Path) -> None:
    done = release(clone, "--tag")
    assert done.returncode == 0, done.stderr
    files = {"hindrax-1.2.3-py3-none-any.whl", "hindrax-1.2.3-site.tar.gz", "hindrax-1.2.3-example.tar.gz"}
    assert {file.name for file in (clone / "dist").iterdir()} == {*files, "SHA256SUMS"}
    subprocess.run(["sha256sum", "--check", "--quiet", "SHA256SUMS"], cwd=clone / "dist", check=True)
    assert git(clone, "tag", "--list") == "v1.2.3\n"
    assert "v1.2.3 is tagged already" in release(clone, "--tag").stderr


def test_without_the_word_nothing_is_tagged_and_the_archives_are_the_same_again(clone: Path) -> None:
    assert release(clone).returncode == 0
    sums = (clone / "dist/SHA256SUMS").read_text()
    assert release(clone).returncode == 0
    assert ((clone / "dist/SHA256SUMS").read_text(), git(clone, "tag", "--list")) == (sums, "")


@pytest.mark.parametrize(
    ("file", "text", "told"),
    [
        ("CHANGELOG.md", "## 1.2.3 (unreleased)\n", "wanted '## 1.2.3 (DATE)'"),
        ("CITATION.cff", "version: 1.2.2\n", "run setup/version.sh 1.2.3"),
    ],
)
def test_what_is_not_ready_is_refused(clone: Path, file: str, text: str, told: str) -> None:
    (clone / file).write_text(text)
    assert "the clone has changes" in release(clone).stderr
    commit(clone)
    done = release(clone)
    assert (done.returncode, (clone / "dist").exists()) == (1, False)
    assert told in done.stderr
    assert release(clone, "--soon").returncode == 2


def test_the_citation_is_complete_and_of_this_version() -> None:
    assert CITATION["version"] == (ROOT / "VERSION").read_text(encoding="utf-8").strip()
    wanted = {"cff-version", "message", "title", "type", "authors", "license", "abstract", "keywords"}
    assert wanted <= CITATION.keys()


@pytest.mark.parametrize("file", sorted((ROOT / ".github").rglob("*.yml")), ids=lambda one: str(one.name))
def test_files_of_a_forge_are_what_it_takes(file: Path) -> None:
    data = yaml.safe_load(file.read_text(encoding="utf-8"))
    if file.parent.name == "ISSUE_TEMPLATE" and file.name != "config.yml":
        assert {"name", "description", "body"} <= data.keys()
        assert all({"type", "id", "attributes"} <= one.keys() for one in data["body"])
    if file.parent.name == "workflows":
        steps = [step for job in data["jobs"].values() for step in job["steps"]]
        assert {"./hindrax pool-test --mock", "./hindrax test"} <= {step.get("run") for step in steps}
