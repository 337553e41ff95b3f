"""Lines as sentences on the page: a word gets its capital letter, a name keeps its letters."""

from __future__ import annotations

import pytest

from emaviz.text.verdicts import begun, warned


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("no measurement is chosen; upload one", "No measurement is chosen; upload one"),
        ("seems to differ", "Seems to differ"),
        ("chirp.csv: its columns are not mapped yet", "chirp.csv: its columns are not mapped yet"),
        ("unit_05 differs from the rest", "unit_05 differs from the rest"),
        ("k1 friction drifts", "k1 friction drifts"),
        ("motor.inertia_kgm2 has no tolerance", "motor.inertia_kgm2 has no tolerance"),
        ("−162 rad/s", "−162 rad/s"),
        ("", ""),
    ],
)
def test_a_word_begins_with_a_capital_letter_and_a_name_does_not(line, shown):
    assert begun(line) == shown


def test_a_unit_keeps_its_name_and_a_note_of_it_begins_as_a_sentence():
    notes = ["right seemed to differ, but its held-out recordings contradict that", "all units lack a load"]
    told = warned(notes, ("left", "right"))
    assert "▲ right seemed" in told and "▲ All units" in told
