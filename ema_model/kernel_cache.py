"""The cache of compiled kernels: its folder, and what is kept there."""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import importlib.metadata
import os
import pickle
import platform
import shutil
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

# --- where compiled kernels lie between runs, and whose that place is -------------------------------------------------
# Whoever may write there runs code in this process: a compiled kernel is a pickle with machine code. So a folder is
# used only when no other user can write to it, or put another in its place; else a temporary one of this process
# stands in, which goes at its end. Kernels lie under a hash of the sources that they are made of and of the versions
# that compile them: an edited effect is another folder, and an old kernel is never served.

_PACKAGE = Path(__file__).parent
# All that a kernel may inline, and how it is composed and kept; `tests/model/test_stacks.py` checks that kernels
# import nothing else of ours.
_COMPILED = ("kernel_cache.py", "stacks.py", "physics/*.py", "kernels/*.py", "effects/*.py")
_KEPT_VERSIONS = 6  # folders of other hashes (older sources or versions) that are left in the cache
_DAY_S = 86_400.0
_DRAFT = ".draft"  # begins the name of a file that is being written
_BY_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def _hash_of_sources() -> str:
    digest = hashlib.sha256()
    for path in sorted(path for part in _COMPILED for path in _PACKAGE.glob(part)):
        digest.update(str(path.relative_to(_PACKAGE)).encode() + b"\0" + path.read_bytes() + b"\0")
    for distribution in ("numba", "llvmlite", "numpy"):
        digest.update(importlib.metadata.version(distribution).encode())
    digest.update(f"{sys.version}{platform.machine()}".encode())
    return digest.hexdigest()[:20]


# Taken while the package is imported: what the kernels inline is what the files held at that time.
_SOURCES = _hash_of_sources()
_finding = threading.Lock()


def cache_folder() -> Path:
    """The folder of this version's kernels: `<root>/kernels/<hash>`, the same for the whole process.

    The root is $EMAVIZ_CACHE_DIR or the user's cache; one that is not safe or cannot be written is told on stderr,
    and is a temporary folder instead.  OSError where even that cannot be made.
    """
    with _finding:
        return _find()


@cache
def _find() -> Path:
    # Links are resolved once, so that what is checked is what is used.
    root = Path(os.path.realpath(os.environ.get("EMAVIZ_CACHE_DIR") or _users_cache()))
    try:
        folder = _made(root)
        fault = _fault(folder, root)
    except OSError as error:
        folder, fault = root, f"{error.filename or root} cannot be written ({error.strerror})"
    if fault is None:
        _prune(folder)
        return folder
    print(
        f"emaviz: the cache of kernels is not used, as {fault}: set it right, or name a folder of yours in "
        "EMAVIZ_CACHE_DIR; until then every start compiles anew",
        file=sys.stderr,
    )
    return _temporary()


def _users_cache() -> Path:
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "emaviz"


def _made(root: Path) -> Path:
    """This version's folder under `root`; what is missing of it is made for the user alone."""
    folder = root / "kernels" / _SOURCES
    for path in reversed([folder, *folder.parents]):
        if not path.is_dir():
            path.mkdir(mode=0o700, exist_ok=True)  # several processes may want it at once
    with tempfile.TemporaryFile(dir=folder):
        pass
    os.utime(folder)
    return folder


def _temporary() -> Path:
    root, process = Path(tempfile.mkdtemp(prefix="emaviz-kernels-")), os.getpid()

    @atexit.register
    def _remove() -> None:
        if os.getpid() == process:  # not a child that was forked
            shutil.rmtree(root, ignore_errors=True)

    return _made(root)


# --- whose it is ----------------------------------------------------------------------------------------------------


def only_ours(info: os.stat_result) -> bool:
    """Whether a file or folder is this user's and nobody else may write to it.

    On Windows always: its modes and owners tell nothing, and the user's cache lies in a profile closed to others.
    """
    return sys.platform == "win32" or (info.st_uid == os.getuid() and not info.st_mode & _BY_OTHERS)


def _fault(folder: Path, root: Path) -> str | None:
    """Why others might write into `folder`, a resolved path at or below the cache's `root`; None when they cannot."""
    if sys.platform == "win32":
        return None
    system = {os.getuid(), 0, os.stat(folder.anchor).st_uid}
    for path in (folder, *folder.parents):
        info = path.lstat()
        if path.is_relative_to(root):
            if not only_ours(info):
                return f"{path} belongs to another user, or others may write to it"
        elif info.st_uid not in system:
            return f"{path} belongs to another user"
        elif _swappable(info):
            return f"others may write to {path}"
    return None


def _swappable(parent: os.stat_result) -> bool:
    """Whether others may rename what lies in a folder above the cache: not in /tmp, whose sticky bit prevents it."""
    if parent.st_mode & stat.S_ISVTX:
        return False
    of_group = parent.st_mode & stat.S_IWGRP and not _holds_the_user_alone(parent.st_gid)
    return bool(parent.st_mode & stat.S_IWOTH or of_group)


def _holds_the_user_alone(group: int) -> bool:
    """Whether a group is root's, or the private one that many systems give each user and let write by default."""
    import grp
    import pwd

    if group == 0:
        return True
    try:
        user, entry = pwd.getpwuid(os.getuid()), grp.getgrgid(group)
    except KeyError:
        return False
    return entry.gr_name == user.pw_name and not set(entry.gr_mem) - {user.pw_name}


# --- what is written and removed ------------------------------------------------------------------------------------


@contextlib.contextmanager
def draft() -> Iterator[Path]:
    """An empty file in the cache, for the user alone, to be renamed when it is whole; what is left of it goes."""
    number, name = tempfile.mkstemp(prefix=_DRAFT, dir=cache_folder())
    os.close(number)
    try:
        yield Path(name)
    finally:
        with contextlib.suppress(OSError):
            os.unlink(name)


def remove(path: Path) -> None:
    """Removes a file or a whole folder, as far as that can be done."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with contextlib.suppress(OSError):
            path.unlink()


def _prune(folder: Path) -> None:
    """Drops the folders of old sources, and drafts whose process was killed; nothing that was used in the last day."""
    others = sorted((path for path in folder.parent.iterdir() if path != folder), key=_age_s, reverse=True)
    for path in [*others[: max(0, len(others) - _KEPT_VERSIONS)], *folder.glob(f"{_DRAFT}*")]:
        if _age_s(path) > _DAY_S:
            remove(path)


def _age_s(path: Path) -> float:
    try:
        return time.time() - path.lstat().st_mtime
    except OSError:  # another process prunes too
        return 0.0


# --- compiled kernels in files that are read only when whole ----------------------------------------------------------
# numba's own cache trusts what it finds: a cut index is an exception in the kernel's call, a changed byte of machine
# code a wrong number or a crash. Here each kernel, compiled for given types of arguments, is one file that begins
# with its checksum; another than was written is removed and compiled again.

_CHECKSUM = hashlib.sha256().digest_size


class Turns(Protocol):
    """Says when this process may compile a kernel that others on its host may be compiling."""

    def begin(self, path: Path) -> None:
        """Returns when nobody else compiles the kernel of this file, which may be there by then."""

    def end(self, path: Path) -> None:
        """The kernel is in its file, or will not be."""


turns: Turns | None = None  # without it each process compiles what it does not find


def kept(compiler: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A decorator as numba's `compiler`, whose functions are kept in the cache."""

    def decorate(function: Callable[..., Any]) -> Any:
        dispatcher = compiler(function)
        dispatcher._cache = KeptKernels(function)
        return dispatcher

    return decorate


class KeptKernels(NullCache):
    """The files of one function, in the place that numba has for a cache.

    They are found by the function's module and name: `ema_model.stacks` names a module after all that it inlines.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._name = f"{function.__module__}.{function.__qualname__}"

    @property
    def cache_path(self) -> str:
        return str(cache_folder())

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        target_context.refresh()  # as numba's own cache does: it may not have been used yet
        try:
            path = self._file(sig, target_context)
            content = _read(path)
            if content is None and turns is not None:
                turns.begin(path)
                if (content := _read(path)) is not None:
                    turns.end(path)
        except OSError:
            return None
        return None if content is None else CompileResult._rebuild(target_context, *pickle.loads(content))

    def save_overload(self, sig: Any, data: CompileResult) -> None:
        if data.library.has_dynamic_globals:  # addresses of this process
            return
        try:
            path = self._file(sig, data.target_context)
            try:
                _write(path, dumps(data._reduce()))
            finally:
                if turns is not None:
                    turns.end(path)
        except OSError:  # a full disk, say: the kernel is compiled and runs
            return

    def _file(self, sig: Any, target_context: Any) -> Path:
        """For these types of arguments on this processor."""
        types = hashlib.sha256(repr((sig, target_context.codegen().magic_tuple())).encode()).hexdigest()
        return cache_folder() / f"{self._name}-{types[:16]}.nbc"


def _checksum(path: Path, content: bytes) -> bytes:
    """Of the name too: one kernel's file is not another's."""
    return hashlib.sha256(path.name.encode() + b"\0" + content).digest()


def _read(path: Path) -> bytes | None:
    try:
        with path.open("rb") as file:
            whole = file.read() if only_ours(os.fstat(file.fileno())) else b""
    except FileNotFoundError:
        return None
    except OSError:  # a folder, or no right to read it
        whole = b""
    content = whole[_CHECKSUM:]
    if whole[:_CHECKSUM] == _checksum(path, content):
        return content
    _tell(path)
    remove(path)
    return None


def _write(path: Path, content: bytes) -> None:
    """Whole or not at all, as several processes may want it at once."""
    with draft() as file:
        file.write_bytes(_checksum(path, content) + content)
        os.replace(file, path)


_told: list[Path] = []


def _tell(path: Path) -> None:
    if not _told:
        print(f"emaviz: {path} is damaged; kernels that cannot be read are compiled again", file=sys.stderr)
    _told.append(path)
