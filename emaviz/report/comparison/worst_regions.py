"""Where the model fails most: each region in words, against its variable, and where it is in time."""

from __future__ import annotations

from ema_model.comparison.regions import worst_moment
from ema_model.comparison.result import Comparison, Region
from ema_model.comparison.words import details
from ema_model.quantities.numbers import number
from ema_model.quantities.variables import variable_title
from emaviz.figures import residual_against, residual_time
from emaviz.figures.region_blocks import time_ranges
from emaviz.report.markup import escape, link, paragraph
from emaviz.report.section import Figures, Section, pair

_STAYS = 8.0  # times the stay in the region is shown
_LEAST_BLOCKS = 400


class WorstRegions(Section[Comparison]):
    """A card for each region, worst first, with links to the full figures."""

    title = "Where it fails"
    anchor = "regions"
    place = 40

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Says so where no region stands out of the floor."""
        if not subject.worst_regions:
            return paragraph("No region stands out of the floor.")
        return "".join(_card(subject, figures, i, region) for i, region in enumerate(subject.worst_regions))


def _card(comparison: Comparison, figures: Figures, index: int, region: Region) -> str:
    recording, block = worst_moment(comparison.residuals, region)
    time_s = float(comparison.residuals.time_s[block])
    name = comparison.recordings[recording].name or f"recording {recording + 1}"
    variable = variable_title(region.variable)
    window = _around(comparison, region, recording, time_s)
    against = residual_against.figure(comparison, region.variable, region.signal, highlight=region)
    over_time = residual_time.figure(
        comparison, region.signal, recording, highlight=region, moment_s=time_s, window_s=window
    )
    links = (
        link(f"against-{region.variable}", f"{variable}: all of it")
        + " · "
        + link(f"recording-{recording + 1}", f"{name}, worst at {number(time_s, 4)} s")
    )
    return (
        f'<div class="region" id="region-{index + 1}"><h3>{index + 1}. {escape(region.sentence)}</h3>'
        + paragraph(details(comparison, region), "dim")
        + pair(figures.place(against, 300), figures.place(over_time, 300))
        + f'<p class="small">Seen in: {links}</p></div>'
    )


def _around(comparison: Comparison, region: Region, recording: int, time_s: float) -> tuple[float, float]:
    """A window of time about the worst moment in which the region's stay there can be seen, from–to, s."""
    time = comparison.recordings[recording].time_s
    first, last = float(time.min()), float(time.max())
    stays = [high - low for low, high in time_ranges(comparison, region, recording) if low <= time_s <= high]
    width = max(_STAYS * max(stays, default=0.0), _LEAST_BLOCKS * comparison.residuals.block_s)
    start = min(max(time_s - 0.5 * width, first), max(last - width, first))
    return start, min(start + width, last)
