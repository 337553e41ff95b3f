"""The locks hold all that is installed, each file by its hash, and the tests run on what users run."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[1]
RUN, TESTS = PROJECT / "lock.txt", PROJECT / "tests" / "lock.txt"


def _locked(lock: Path) -> dict[str, tuple[set[str], int]]:
    """By distribution: its pinned lines, and how many hashes they carry."""
    found: dict[str, tuple[set[str], int]] = {}
    for block in re.split(r"\n(?=[a-z0-9])", lock.read_text(encoding="utf-8")):
        if pinned := re.match(r"([a-z0-9.-]+)==[^\\\n]+", block):
            lines, hashes = found.get(pinned[1], (set(), 0))
            found[pinned[1]] = lines | {pinned[0].strip()}, hashes + block.count("--hash=sha256:")
    return found


def _asked(*requirements: str) -> list[str]:
    return [re.split(r"[<>=!~ \[;]", requirement)[0].lower() for requirement in requirements]


def _project() -> dict:
    return tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("lock", [RUN, TESTS], ids=["run", "tests"])
def test_each_locked_file_is_known_by_its_hash(lock: Path) -> None:
    without = [name for name, (pins, hashes) in _locked(lock).items() if hashes < len(pins)]
    assert _locked(lock) and not without


def test_locks_hold_what_the_project_asks_for_and_its_build_backend() -> None:
    project = _project()
    needed = _asked(
        *project["project"]["dependencies"],
        *project["build-system"]["requires"],
        *project["dependency-groups"]["build"],
    )
    extras = project["project"]["optional-dependencies"]
    assert {*needed, *_asked(*extras["rigs"])} <= set(_locked(RUN)), "the README's install reads all that it lists"
    assert set(_asked(*extras["dev"], *extras["cluster"], *extras["rigs"])) <= set(_locked(TESTS))


def test_whoever_runs_no_cluster_installs_none() -> None:
    assert not set(_asked(*_project()["project"]["optional-dependencies"]["cluster"])) & set(_locked(RUN))


def test_tests_run_on_the_versions_that_users_run() -> None:
    run, tests = _locked(RUN), _locked(TESTS)
    assert {name: tests[name] for name in run} == run


def test_the_readme_and_ci_install_by_hash() -> None:
    readme = (PROJECT / "README.md").read_text(encoding="utf-8")
    assert "pip install --require-hashes -r lock.txt" in readme
    assert "pip install --require-hashes -r tests/lock.txt" in readme
    assert "--require-hashes -r tests/lock.txt" in (PROJECT / ".ci" / "run").read_text(encoding="utf-8")
