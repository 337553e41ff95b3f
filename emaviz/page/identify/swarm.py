"""How the swarm is looked at: as points over two k or as lines across all eight, live or at an earlier iteration."""

from __future__ import annotations

import numpy as np

from ema_model.faults import FAULTS, HEALTHY
from emaviz.figures import swarm
from emaviz.figures.convergence import colour
from emaviz.page.inset import NEXT_COLUMN
from emaviz.page.page import Page
from emaviz.session.identify.race import Frame, Race, Track
from emaviz.text.html import add_html

_PLANE, _LINES = "points over two k", "lines across all k"
_NAMES = tuple(fault.label for fault in FAULTS)


class SwarmView:
    """The picture and its controls, which `appear` with the first race."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._race: Race | None = None
        self._chosen = False  # by hand, which two k
        gui = page.server.gui
        self._folder = gui.add_folder("Population", visible=False)
        with self._folder:
            add_html(gui, NEXT_COLUMN)
            self._picture = add_html(gui, swarm.plane([], 0, 5))
        self._kind = gui.add_dropdown("Population view", (_PLANE, _LINES), visible=False)
        self._x = gui.add_dropdown("Horizontal axis", _NAMES, initial_value=_NAMES[0], visible=False)
        self._y = gui.add_dropdown("Vertical axis", _NAMES, initial_value=_NAMES[5], visible=False)
        self._iteration = gui.add_slider(
            "Iteration", 0, 150, 1, 150, disabled=True, visible=False, hint="Looks back once it is over"
        )
        for entry in (self._kind, self._iteration):
            entry.on_update(lambda event: event.client and page.screen.post("swarm view", self._changed))
        for entry in (self._x, self._y):
            entry.on_update(lambda event: event.client and page.screen.post("swarm axes", self._choose))

    def appear(self) -> None:
        """There is something to look at."""
        for one in (self._folder, self._kind, self._iteration):
            one.visible = True
        self._show_axes()

    def show(self, race: Race, begun: bool) -> None:
        """Draws a race as it stands; on the screen's thread."""
        self._race = race
        over = all(track.answer is not None for track in race.tracks.values())
        last = max((len(track.rmse) - 1 for track in race.tracks.values()), default=1)
        last = max(last, 1)
        if begun and race.truth is not None and not self._chosen:
            x, y = telling(race.truth)
            self._x.value, self._y.value = _NAMES[x], _NAMES[y]
        reach = last if over else max(track.iterations for track in race.tracks.values())
        if self._iteration.max != reach:
            self._iteration.value = min(self._iteration.value, reach)
            self._iteration.max = reach
        if over:
            self._iteration.value = last
        self._iteration.disabled = not over
        self._draw(last)

    def _choose(self) -> None:
        self._chosen = True
        self._changed()

    def _changed(self) -> None:
        self._show_axes()
        self._draw(int(self._iteration.value) if not self._iteration.disabled else 10**9)

    def _show_axes(self) -> None:
        self._x.visible = self._y.visible = self._kind.value != _LINES

    def _draw(self, iteration: int) -> None:
        race = self._race
        if race is None:
            self._picture.content = swarm.lines([]) if self._kind.value == _LINES else swarm.plane([], *self._axes())
            return
        swarms, trails = [], []
        for track in list(race.tracks.values()):
            frame = at_iteration(track, iteration)
            if frame is None:
                continue
            swarms.append(swarm.Swarm(track.algorithm, colour(track.algorithm), frame.population, frame.k))
            trails.append(np.array([one.k for one in list(track.frames) if one.iteration <= frame.iteration]))
        if self._kind.value == _LINES:
            self._picture.content = swarm.lines(swarms, race.truth)
        else:
            self._picture.content = swarm.plane(swarms, *self._axes(), race.truth, trails)

    def _axes(self) -> tuple[int, int]:
        return _place(self._x.value, 0), _place(self._y.value, 5)


def at_iteration(track: Track, iteration: int) -> Frame | None:
    """The swarm then, or the last one that is kept from before; the newest while the race runs."""
    frames = [frame for frame in list(track.frames) if frame.iteration <= iteration]
    if track.last is not None and track.last.iteration <= iteration:
        last = track.last
        return Frame(last.iteration, last.population.astype(np.float32), last.k, last.rmse)
    return frames[-1] if frames else None


def telling(truth: np.ndarray) -> tuple[int, int]:
    """The two k that are farthest from healthy: there one sees most."""
    away = np.abs(truth - HEALTHY)
    away[6] *= truth[5]  # a phase of no eccentricity means nothing
    first, second = np.argsort(-away, kind="stable")[:2]
    return (int(first), int(second)) if away[second] > 0.0 else (int(first), 5 if first != 5 else 0)


def _place(name: str, default: int) -> int:
    return _NAMES.index(name) if name in _NAMES else default
