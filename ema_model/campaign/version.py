"""What results depend on besides their task: the sources, and the libraries that compute."""

from __future__ import annotations

import hashlib
import importlib.metadata
import subprocess
from functools import cache
from pathlib import Path

_PACKAGE = Path(__file__).parents[1]
_LIBRARIES = ("numpy", "scipy", "numba", "llvmlite")
_OF_A_RESULT = ("task.py", "given.py", "showable.py", "kinds/")  # of this folder; the rest only moves tasks and rows


@cache
def version() -> dict[str, str]:
    """By what: the package's version, a hash of its sources, the libraries' versions."""
    try:
        package = importlib.metadata.version("emaviz")
    except importlib.metadata.PackageNotFoundError:  # run from the sources without an installation
        package = "0+source"
    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        inside = path.relative_to(_PACKAGE).as_posix()
        if not inside.startswith("campaign/") or inside.removeprefix("campaign/").startswith(_OF_A_RESULT):
            digest.update(inside.encode() + b"\0" + path.read_bytes() + b"\0")
    libraries = {name: importlib.metadata.version(name) for name in _LIBRARIES}
    return {"emaviz": package, "sources": digest.hexdigest()[:12], **libraries}


def differences(one: dict[str, str], other: dict[str, str]) -> str:
    """In what two versions differ: 'emaviz 0.1.0 / 0.2.0, numpy 2.4.6 / 2.5.0'; empty where they are the same."""
    names = [name for name in {**one, **other} if one.get(name) != other.get(name)]
    return ", ".join(f"{name} {one.get(name, 'none')} / {other.get(name, 'none')}" for name in names)


def commit() -> str:
    """The commit of the sources, with a + where they were changed since; empty where they are in no repository."""

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(_PACKAGE), *arguments]
        return subprocess.run(command, capture_output=True, text=True, timeout=10, check=True).stdout.strip()

    try:
        return git("rev-parse", "--short=10", "HEAD") + ("+" if git("status", "--porcelain", ".") else "")
    except (OSError, subprocess.SubprocessError):
        return ""
