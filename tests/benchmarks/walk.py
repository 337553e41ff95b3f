"""How many rooms three runs lead through, as data: python tests/benchmarks/walk.py [--path]

A room is a module of ours, or a folder of a package.  The walk is that of a reader who follows a run from its first
call to its last: into each function when it is called for the first time, and back to where it was called from.  A stay
is an unbroken time in one room, a return a stay in a room that was left before, so that stays are rooms and returns
together.  `--path` tells the rooms in their order.  Each run is done once before, so that nothing is imported or
compiled on the way.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import itertools
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

PROJECT = Path(__file__).parents[2]
sys.path.insert(0, str(PROJECT))
OURS = tuple(f"{PROJECT / package}/" for package in ("ema_model", "emaviz"))
_SETTLED_S = 1.0  # without a step, after which a run that goes over several threads has ended
_APART = ("emaviz-playback", "emaviz-job-clock")  # threads that go on by themselves


class Walk:
    """The rooms entered by whatever is called within `walking`, on every thread that has begun since it was made."""

    def __init__(self) -> None:
        self.stays: list[str] = []
        self.stepped_at = time.monotonic()
        self._goes = False
        self._read: set[CodeType] = set()
        self._at = threading.local()
        threading.setprofile(self._event)

    @contextlib.contextmanager
    def walking(self) -> Iterator[None]:
        """Watches this thread as well."""
        self._goes = True
        sys.setprofile(self._event)
        try:
            yield
        finally:
            sys.setprofile(None)
            self._goes = False

    def settle(self) -> None:
        """Waits until no thread steps any more."""
        while time.monotonic() - self.stepped_at < _SETTLED_S:
            time.sleep(0.05)

    def _event(self, frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if not self._goes or event not in ("call", "return") or not code.co_filename.startswith(OURS):
            return
        if not code.co_flags & inspect.CO_OPTIMIZED or threading.current_thread().name in _APART:
            return  # the body of a module or a class
        stack = self._at.__dict__.setdefault("stack", [])
        if event == "call":
            stack.append((frame, self._at.__dict__.get("room")))
            if code not in self._read:
                self._read.add(code)
                self._enter(code.co_filename)
        elif stack and stack[-1][0] is frame:
            room = stack.pop()[1]
            if room is not None and room != self._at.room:
                self._enter(room)

    def _enter(self, room: str) -> None:
        self._at.room, self.stepped_at = room, time.monotonic()
        if not self.stays or self.stays[-1] != room:
            self.stays.append(room)


def command(*arguments: str) -> None:
    """A run of the command line, its output put away."""
    from emaviz.cli import main

    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        if code := main(list(arguments)):
            raise SystemExit(f"emaviz {' '.join(arguments)} ended with {code}")


def walked(run: Callable[[], None]) -> Walk:
    """A run's rooms, the second time that it is done."""
    run()
    walk = Walk()
    try:
        with walk.walking():
            run()
    finally:
        threading.setprofile(None)  # type: ignore[arg-type]
    return walk


def slider_to_chart(folder: Path) -> Walk:
    """From a fault's slider to the redrawn signals, over the threads that compute and draw."""
    from emaviz.page.app import App
    from emaviz.page.explore import ExploreTab

    walk = Walk()  # before the app, whose threads it is to watch
    app = App("127.0.0.1", 0, folder)
    try:
        app.wait_for_first_picture(300.0)
        app.session.ready.wait(300.0)
        app.strip.play(False)
        panel = app.tab(ExploreTab).panel
        for value in (0.2, 0.4):  # the first warms up
            walk.settle()
            panel._sliders[0].value = value
            if value == 0.2:
                panel._slide(0)
                time.sleep(3.0)
                continue
            with walk.walking():
                panel._slide(0)
                walk.stepped_at = time.monotonic()
                walk.settle()
    finally:
        threading.setprofile(None)  # type: ignore[arg-type]
        app.close()
    return walk


def told(title: str, walk: Walk) -> None:
    """Lines of figures by module and by folder of a package, and the rooms where they are asked for."""
    modules = [str(Path(room).relative_to(PROJECT)) for room in walk.stays]
    folders = [one for one, _ in itertools.groupby("/".join(Path(room).parts[:2]) for room in modules)]
    for kind, stays in (("modules", modules), ("folders", folders)):
        rooms = len(set(stays))
        print(f"{title:36} {kind} {len(stays):4} stays {rooms:4} rooms {len(stays) - rooms:4} returns")
    if "--path" in sys.argv:
        print("  " + "\n  ".join(modules))


def main() -> None:
    """Walks the three runs."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file, recording = str(folder / "friction.csv"), str(folder / "run.rrd")
        command("simulate", "--fault", "k1=0.25", "--noise-current", "0.1", "--out", file)
        told("file → words (emaviz compare FILE)", walked(lambda: command("compare", file)))
        found = ("--fault", "k1=0.25", "--algorithm", "do", "--iterations", "5", "--population", "10")
        told(
            "k → .rrd (emaviz identify --record)",
            walked(lambda: command("identify", *found, "--record", recording, "--force")),
        )
        told("slider → chart (Explore)", slider_to_chart(folder / "data"))


if __name__ == "__main__":
    main()
