"""Abbreviations are explained where they stand, and nothing else of a text changes."""

from __future__ import annotations

import re

from emaviz.text.html import TERMS, explained, html


def test_a_term_is_explained_once_and_the_text_stays():
    text = "Err 0.01 % · corrected error 19 mA; uncorrected error 20 mA, error 3.5 × floor, Error and rmse"
    told = explained(text)
    assert re.sub(r"<[^>]*>", "", told) == text
    assert re.findall(r"<abbr[^>]*>([^<]*)", told) == ["Err", "corrected error", "uncorrected error", "× floor"]
    assert str(html('title="{}"', TERMS["Err"])) in told
    assert explained("rms, rms").count("<abbr") == 1


def test_markup_stays_what_it_is_and_foreign_text_becomes_none():
    assert "&lt;b&gt;" in explained("<b> rms")
    told = explained(html('<div title="rms">a<style>.rms{{}}</style><summary>rms</summary> σ</div>'))
    assert told.count("<abbr") == 1 and 'title="rms"' in told
