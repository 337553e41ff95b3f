"""Compiled kernels in files that are read only when whole.

numba's own cache trusts what it finds: a cut index is an exception in the kernel's call, a changed byte of
machine code a wrong number or a crash.  Here each kernel, compiled for given types of arguments, is one file that
begins with its checksum; another than was written is removed and compiled again.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from ema_model.kernel_cache.folder import cache_folder, draft, only_ours, remove

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
