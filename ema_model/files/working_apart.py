"""The process that `apart` asks: a line of JSON in, a line of JSON and the arrays' bytes out."""

from __future__ import annotations

import importlib
import json
import os
import sys
import time
import warnings
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np

from ema_model.child_processes import end_with_parent
from ema_model.errors import InputError, quoted


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
