"""What explains the residual: the ranking, the orders of the motor's turn, and the residual against each variable."""

from __future__ import annotations

import numpy as np

from ema_model.comparison.result import Comparison
from ema_model.quantities.variables import VARIABLES
from emaviz.figures import explained, order_spectrum, quantity, residual_against, residual_polar
from emaviz.report.markup import folded, paragraph, table
from emaviz.report.section import Figures, Section, pair

_FIRST = 4  # explanations are written out; the bars show all
_NOTE = (
    "A variable explains the residual as far as a curve of it, fitted to a part of the data, tells the rest ahead. "
    "Pale bars are what noise could have made."
)


class WhatExplains(Section[Comparison]):
    """All of the primary signal."""

    title = "What explains the residual"
    anchor = "explained"
    place = 50

    def body(self, subject: Comparison, figures: Figures) -> str:
        """Without variables that are known there is nothing to tell."""
        known = [v for v in VARIABLES if np.any(np.isfinite(subject.residuals.variables.get(v, np.zeros(0))))]
        if not known:
            return ""
        told = [e for e in subject.explained_by if e.significant][:_FIRST]
        parts = [paragraph(e.sentence) for e in told] or [paragraph("No variable explains it beyond noise.")]
        # a row for each variable and the axis below
        tall = max(260, 100 + 44 * len({e.variable for e in subject.explained_by}))
        parts += [figures.place(explained.figure(subject), tall, "explained-by"), paragraph(_NOTE, "small")]
        if "motor_angle" in known and subject.actuator.axes.motor == "rotary":
            polar = figures.place(residual_polar.figure(subject), 400, "polar")
            parts.append(pair(polar, figures.place(order_spectrum.figure(subject), 400, "orders")))
            if subject.orders:
                parts.append(folded("The orders in numbers", _orders(subject)))
        order = list(dict.fromkeys(e.variable for e in subject.explained_by if e.variable in known))
        against = [
            figures.place(residual_against.figure(subject, variable), 340, f"against-{variable}")
            for variable in dict.fromkeys(order + known)
        ]
        return "".join(parts) + pair(*against)


def _orders(comparison: Comparison) -> str:
    largest = max(order.amplitude for order in comparison.orders)
    shown = quantity.of_residual(comparison, comparison.primary, as_torque=True).scaled(largest)
    rows = [
        [f"{order.order}", shown.text(order.amplitude), f"{np.degrees(order.phase):.0f}°"]
        for order in comparison.orders[:20]
    ]
    return table(["Periods in each turn", "amplitude", "phase"], rows)
