"""The Identify tab: find the faults that the sliders set, while one watches."""

from __future__ import annotations

import html
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import viser

from ema_model.faults import HEALTHY
from ema_model.identification.objective import FITNESSES
from ema_model.identification.optimisers import OPTIMISERS
from ema_model.identification.run import Identification, Progress
from emaviz.figures.convergence import LiveConvergence
from emaviz.figures.fault_bars import fault_bars
from emaviz.panels.page import Page
from emaviz.recording.viewer import ViewerHost


class IdentifyPanel:
    """Algorithm and its settings, run and stop, convergence, k bars, the recording's link."""

    def __init__(self, page: Page, viewer: ViewerHost | None) -> None:
        self._page = page
        self._viewer = viewer
        self._rmse: list[float] = []
        gui, settings = page.server.gui, page.session.settings
        algorithm = gui.add_dropdown("Algorithm", tuple(OPTIMISERS), initial_value=settings.algorithm)
        population = gui.add_number("Population", settings.population, min=4, max=1000, step=1)
        iterations = gui.add_number("Iterations", settings.iterations, min=1, max=5000, step=1)
        fitness = gui.add_dropdown("Fitness", FITNESSES, initial_value=settings.fitness)
        seed = gui.add_number("Seed", settings.seed, min=0, step=1)
        for entry, change in (
            (algorithm, settings.set_algorithm),
            (population, settings.set_population),
            (iterations, settings.set_iterations),
            (fitness, settings.set_fitness),
            (seed, settings.set_seed),
        ):
            self._listen(entry, change)
        self._start = gui.add_button("Identify", icon=viser.Icon.SEARCH)
        self._stop = gui.add_button("Stop", icon=viser.Icon.PLAYER_STOP, color="red", disabled=True)
        self._progress = gui.add_progress_bar(0.0)
        self._text = gui.add_markdown("Finds the faults that the sliders of *Explore* have set.")
        self._convergence = LiveConvergence(gui)
        self._bars = gui.add_html(fault_bars(HEALTHY, page.session.actuator))
        self._link = gui.add_html("")
        self._start.on_click(lambda _: self._begin())
        self._stop.on_click(lambda _: page.session.stop())
        page.session.events.progressed.append(self._progressed)
        page.session.events.identified.append(self._identified)

    def _listen(self, entry: Any, setter: Callable[[Any], None]) -> None:
        def changed(_: Any) -> None:
            self._page.checked(lambda: setter(entry.value))

        entry.on_update(changed)

    def _begin(self) -> None:
        if not self._page.session.ready.is_set():
            self._page.notify("One moment", "The models are still being compiled.", "yellow")
            return
        settings = self._page.session.settings
        if not self._page.session.identify():
            self._page.notify("One at a time", "An identification is running; stop it first.", "yellow")
            return
        self._stop.disabled = False
        self._start.disabled = True
        self._link.content = ""
        self._text.content = "Starting…"
        self._convergence.begin(settings.algorithm, settings.iterations)

    def failed(self) -> None:
        """Gives the button back when no identification runs any more."""
        if not self._page.session.worker.busy:
            self._start.disabled, self._stop.disabled = False, True

    def _progressed(self, at: Progress, truth: np.ndarray) -> None:
        if at.iteration == 0:
            self._rmse = []
        self._rmse.append(at.rmse)
        rmse = list(self._rmse)
        self._page.screen.post("identification", lambda: self._draw(at, truth, rmse))

    def _draw(self, at: Progress, truth: np.ndarray, rmse: list[float]) -> None:
        self._progress.value = 100.0 * at.iteration / max(at.iterations, 1)
        self._text.content = (
            f"**{OPTIMISERS[at.algorithm].title}** · iteration {at.iteration} of {at.iterations} · "
            f"rmse {at.rmse:.4f} A · {at.elapsed_s:.1f} s"
        )
        self._convergence.show(rmse)
        self._bars.content = fault_bars(at.k, self._page.session.actuator, truth)

    def _identified(self, answer: Identification, path: Path | None) -> None:
        self._page.screen.post("identification", lambda: self._draw_answer(answer, path))

    def _draw_answer(self, answer: Identification, path: Path | None) -> None:
        sure = answer.uncertainty
        self._start.disabled, self._stop.disabled = False, True
        self._progress.value = 100.0
        verdict = "healthy" if sure.healthy else f"not healthy: {', '.join(sure.alarms) or 'no single k stands out'}"
        stopped = "stopped · " if answer.stopped else ""
        self._text.content = (
            f"**{OPTIMISERS[answer.algorithm].title}** · {stopped}Err {answer.error_percent:.2f} % · "
            f"rmse {answer.rmse:.4f} A · {answer.evaluations} simulations in {answer.elapsed_s:.2f} s · **{verdict}**"
        )
        self._convergence.show(answer.rmse_history.tolist())
        self._bars.content = fault_bars(
            answer.k, self._page.session.actuator, answer.truth, sure.interval90, sure.alarms
        )
        if path is not None:
            self._link.content = recording_link(self._viewer, path)


def recording_link(viewer: ViewerHost | None, path: Path) -> str:
    """A link that opens a recording in the Rerun viewer, or its name where there is none."""
    name = html.escape(path.name)
    if viewer is None:
        return f'<div style="padding:2px 10px;font-size:13px">{name}</div>'
    url: Any = html.escape(viewer.url_of(path.name), quote=True)
    return (
        f'<div style="padding:2px 10px;font-size:13px"><a href="{url}" target="_blank" rel="noopener">'
        f"Open {name} in Rerun ↗</a></div>"
    )
