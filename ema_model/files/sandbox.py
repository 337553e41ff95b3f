"""Work on foreign files in a process of its own."""

from __future__ import annotations

import atexit
import importlib
import json
import os
import subprocess
import sys
import threading
import time
import warnings
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ema_model.child_processes import end_with_parent, start_python
from ema_model.errors import InputError, quoted

# --- work on a file that may mean harm, done by a process of its own, which may crash ---------------------------------
# Work on a file that may mean harm, done by a process of its own, which may crash, hang or fill its memory.
#
# Many formats are read by libraries in C, which end the whole process on some damaged files. So their work is done by
# a process beside, with a bound to its memory and its time; when it ends, the next file gets a new one.

Array = NDArray[np.float64]
Answer = tuple[Any, list[Array]]

_GROUND = 400_000_000  # bytes that libraries take by themselves
_LARGE = 300_000_000  # bytes in use from which on a process is not kept: what it freed may stay with it


class Broken(Exception):
    """The process ended before it answered, or was ended; the text says how, for a person."""


def ask(function: str, *arguments: Any, most_bytes: int, patience_s: float) -> Answer:
    """What `module:function` answers to arguments that JSON can carry: what JSON can carry, and arrays (n,) each.

    Raises the InputError that the function raises, and Broken if it crashes, takes more memory than its libraries
    and `most_bytes`, or more than `patience_s` of time.  One question is answered at a time.  A process that has grown
    large is given up.
    """
    request = {"function": function, "arguments": arguments, "most_bytes": most_bytes + _GROUND}
    request["most_seconds"] = 2.0 * patience_s  # of computing on all cores
    with _lock:
        process = _started()
        assert process.stdin is not None and process.stdout is not None
        late = threading.Timer(patience_s, process.kill)
        late.start()
        try:
            process.stdin.write(json.dumps(request).encode() + b"\n")
            process.stdin.flush()
            answer = json.loads(process.stdout.readline() or b"null")
            arrays = [_array(process.stdout, size) for size in answer["sizes"]] if answer else []
        except (OSError, ValueError, EOFError):
            answer, arrays = None, []
        except BaseException:
            _end()  # an answer half read would be taken for the next one's
            raise
        finally:
            was_late = not late.is_alive()
            late.cancel()
        if not answer or answer["bytes"] > _LARGE:
            _end()
    if not answer:
        how = f"takes over {patience_s:g} s to read" if was_late else "breaks the library that reads it"
        raise Broken(how)
    if "refused" in answer:
        raise InputError(answer["refused"])
    if "broken" in answer:
        raise Broken(answer["broken"])
    return answer["result"], arrays


def process_id() -> int | None:
    """Of the process that works now, if there is one."""
    return _process.pid if _process is not None and _owner == os.getpid() else None


_lock = threading.Lock()
_process: subprocess.Popen[bytes] | None = None
_owner = 0  # the process that started it; a fork must not share it


def _started() -> subprocess.Popen[bytes]:
    global _process, _owner
    if _process is None or _owner != os.getpid() or _process.poll() is not None:
        same = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "OPENBLAS_NUM_THREADS": "1"}
        program = ["-c", "from ema_model.files.sandbox import work; work()"]
        _process = start_python(
            program, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=same, start_new_session=True
        )
        _owner = os.getpid()
    return _process


@atexit.register
def _end() -> None:
    global _process
    if _process is not None and _owner == os.getpid():
        _process.kill()
        with suppress(OSError):  # of what was still to be sent
            _process.communicate()
        _process = None


def _array(pipe: Any, size: int) -> Array:
    values = np.empty(size)
    view, at = values.view(np.uint8), 0
    while at < view.size:
        got = pipe.readinto(view[at:])
        if not got:
            raise EOFError
        at += got
    return values


# --- the process that `apart` asks: a line of JSON in, a line of JSON and the arrays' bytes out -----------------------


def work() -> None:
    """Answers until whoever asks has ended."""
    requests = SimpleQueue[bytes]()

    def receive() -> None:
        for line in sys.stdin.buffer:
            requests.put(line)

    end_with_parent(receive)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # libraries print
    warnings.simplefilter("ignore")
    while True:
        request = json.loads(requests.get())
        _bound(request["most_bytes"], request["most_seconds"])
        result: dict[str, Any] = {}
        arrays = []
        try:
            module, _, function = request["function"].partition(":")
            result["result"], arrays = getattr(importlib.import_module(module), function)(*request["arguments"])
        except InputError as error:
            result["refused"] = str(error)
        except MemoryError:
            result["broken"] = "takes too much memory to read"
        except BaseException as error:  # of a library in native code it may be none of Exception
            result["broken"] = quoted(f"{type(error).__name__}: {error}", 80)
        result["sizes"] = [array.size for array in arrays]
        result["bytes"] = _memory("VmRSS")
        answers.write(json.dumps(result).encode() + b"\n")
        for array in arrays:
            answers.write(np.ascontiguousarray(array, np.float64).data)
        answers.flush()
        del arrays


def _bound(most_bytes: int, most_seconds: float) -> None:
    """No more memory than that, and no more of computing.

    Where the system does not know such bounds, whoever asks ends the process when its patience does.
    """
    try:
        import resource

        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        resource.setrlimit(resource.RLIMIT_DATA, (most_bytes, hard))
        hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
        resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time() + most_seconds) + 2, hard))
    except (ImportError, ValueError, OSError):
        return


def _memory(which: str) -> int:
    """Bytes of this process by Linux's account; 0 elsewhere."""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return 0
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith(which)), 0)
