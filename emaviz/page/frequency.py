"""The Bode tab: the measured frequency response beside the model's."""

from __future__ import annotations

from typing import ClassVar

import viser

from ema_model.analyses.frequency import sweep
from emaviz.page.analysis_tab import AnalysisTab
from emaviz.page.workspaces import Workspace
from emaviz.text.html import Html

WORKSPACE = Workspace("frequency", "Bode", viser.Icon.WAVE_SINE, 7, share=0.66, lower=True)


class FrequencyTab(AnalysisTab):
    """Of the recordings that are chosen on Compare."""

    workspace = WORKSPACE
    analysis = "frequency"
    about = (
        "The transfer function of what was measured, and of the model under the same input, by one estimate: where a "
        "resonance lies, how it is damped, how late the answer comes, and where the two differ beyond the scatter."
    )
    steps: ClassVar = (
        "Choose recordings with a chirp, a multisine or noise of some seconds on Compare, and the actuator there.",
        Html("Press <b>Frequency response</b>: the model is simulated on what was put in."),
        "You see magnitude, phase and coherence, and read where measured and model differ beyond the scatter.",
    )
    meanwhile = "The model is simulated on what was put in, and both responses are estimated alike."
    example = (
        "Run an example",
        "A sweep over the resonance of a shaft that twists: simulated, then analysed.",
    )
    record_example = sweep
