"""Sliders for the parameters of a user's torque, and the ranges that they move in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ema_model.effects.user.torque import RANGE
from ema_model.errors import InputError
from emaviz.page.page import Page
from emaviz.session.described import number

_START = 1e-3  # N·m and the like: a torque at the motor is some thousandths
_USUAL = 0.05  # a slider's reach, as long as nobody has set another
_STEPS = 500


class ParameterSliders:
    """A folder with a slider for each name, and a folded one with the ranges.  moved() follows each change."""

    def __init__(self, page: Page, moved: Callable[[], None]) -> None:
        self._page, self._moved = page, moved
        self._sliders: dict[str, Any] = {}
        self._ranges: dict[str, Any] = {}
        gui = page.server.gui
        self._folder = gui.add_folder("Its parameters", visible=False)
        self._wide = gui.add_folder("Ranges of the parameters", visible=False, expand_by_default=False)

    def list(self, names: tuple[str, ...]) -> None:
        """These parameters; those that stay keep their values and ranges."""
        if tuple(self._sliders) == names:
            return
        values = {name: slider.value for name, slider in self._sliders.items()}
        ranges = {name: entry.value for name, entry in self._ranges.items()}
        for control in (*self._sliders.values(), *self._ranges.values()):
            control.remove()
        self._sliders, self._ranges = {}, {}
        self._folder.visible = self._wide.visible = bool(names)
        for name in names:
            low, high = ranges.get(name, (-_USUAL, _USUAL))
            with self._folder:
                self._sliders[name] = self._slider(name, float(low), float(high), float(values.get(name, _START)))
            with self._wide:
                entry = self._page.server.gui.add_vector2(
                    f"{name} from, to", (float(low), float(high)), step=1e-4, hint="Of the slider, and of the fit"
                )
            entry.on_update(lambda event, name=name: event.client and self._post_range(name))
            self._ranges[name] = entry

    @property
    def values(self) -> dict[str, float]:
        """As the sliders stand; a fit begins there."""
        return {name: number(slider.value, name) for name, slider in self._sliders.items()}

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Those that somebody has set: a fit keeps to them."""
        found = {name: _range(name, entry.value) for name, entry in self._ranges.items()}
        return {name: limits for name, limits in found.items() if limits != (-_USUAL, _USUAL)}

    def _slider(self, name: str, low: float, high: float, value: float) -> Any:
        step = float(f"{(high - low) / _STEPS:.0e}")
        value = min(max(value, low), high)
        slider = self._page.server.gui.add_slider(
            name, low, high, step, value, hint="What it does is drawn below; the fit begins here"
        )
        slider.on_update(lambda event: event.client and self._moved())
        return slider

    def _post_range(self, name: str) -> None:
        def take() -> None:
            self._page.checked(lambda: self._take_range(name), self._ranges[name])

        self._page.screen.post(f"range of {name}", take)

    def _take_range(self, name: str) -> None:
        low, high = _range(name, self._ranges[name].value)
        slider = self._sliders[name]
        with self._page.server.atomic():
            slider.min, slider.max = low, high
            slider.step = float(f"{(high - low) / _STEPS:.0e}")
            slider.precision = 7
            slider.value = min(max(float(slider.value), low), high)
        self._moved()


def _range(name: str, limits: Any) -> tuple[float, float]:
    low, high = (number(limit, f"the range of {name}") for limit in limits)
    if not RANGE[0] <= low < high <= RANGE[1]:
        raise InputError(f"the range of {name} must go from a number to a larger one within ±{RANGE[1]:g}")
    return low, high
