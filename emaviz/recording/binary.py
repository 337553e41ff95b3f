"""Rerun's own command line program, run without its telemetry."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from ema_model.child_processes import start_program
from emaviz.recording.errors import RecordingError


def rerun_binary() -> Path:
    """The program in the installed package.  Its Python wrapper would leave it running when it is stopped itself."""
    spec = importlib.util.find_spec("rerun_cli")
    if spec is not None and spec.origin is not None:
        path = Path(spec.origin).with_name("rerun.exe" if sys.platform == "win32" else "rerun")
        if path.is_file():
            return path
    raise RecordingError("the program of rerun-sdk is missing; install rerun-sdk again")


@contextmanager
def started(*arguments: str, output: IO[bytes] | None = None) -> Iterator[subprocess.Popen[str]]:
    """The program running, its messages on `stderr`; stopped at the end if it has not ended by itself.

    output: as of `run`.
    """
    with tempfile.TemporaryDirectory(prefix="emaviz-") as folder:
        # Analytics are on unless a configuration says otherwise; this one is ours alone.
        settings = Path(folder, "rerun", "analytics.json")
        settings.parent.mkdir()
        settings.write_text(json.dumps({"analytics_enabled": False, "analytics_id": "none", "metadata": {}}))
        environment = os.environ | {"XDG_CONFIG_HOME": folder, "NO_COLOR": "1"}
        process = start_program(
            [str(rerun_binary()), *arguments],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL if output is None else output,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            env=environment,
        )
        try:
            yield process
        finally:
            process.kill()
            process.communicate()


def run(*arguments: str, timeout_s: float, output: IO[bytes] | None = None) -> None:
    """Runs it to its end; RecordingError with its last message if it fails or takes longer.

    output: a file for what it prints.
    """
    with started(*arguments, output=output) as process:
        try:
            _, messages = process.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            raise RecordingError(f"rerun {' '.join(arguments[:2])} took more than {timeout_s:g} s") from None
    if process.returncode != 0:
        lines = messages.strip().splitlines() or [f"exit code {process.returncode}"]
        raise RecordingError(f"rerun {' '.join(arguments[:2])} failed: {lines[-1].strip()}")
