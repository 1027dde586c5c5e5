"""The page's text colours stand out from what they lie on, in light and dark (WCAG AA)."""

import re
from pathlib import Path

import pytest

STYLE = Path(__file__).parents[3] / "web" / "page" / "style.css"
AA_SMALL = 4.5
"""Least ratio for small text: WCAG 2.2, success criterion 1.4.3."""
ON_SURFACES = ("ink", "ink-2", "ink-3")
SURFACES = ("bg", "panel", "sunken")
PAIRS = (
    *((text, surface) for text in ON_SURFACES for surface in SURFACES),
    *((tone, f"{tone}-soft") for tone in ("accent", "good", "warn", "bad")),
    *((tone, "panel") for tone in ("accent", "good", "warn", "bad")),
    *(("ink", f"{tone}-soft") for tone in ("accent", "good", "warn", "bad")),
    *(("ink-2", f"{tone}-soft") for tone in ("accent", "good", "warn", "bad")),
    ("accent-ink", "accent"),
    ("panel", "ink"),
    ("panel", "bad"),
)
"""Text and what it lies on, as the rules of the style sheets combine them."""


def tokens(scheme: str) -> dict[str, str]:
    """Return the colours of a scheme by name."""
    text = STYLE.read_text()
    light, dark = re.findall(r":root \{(.*?)\}", text, re.DOTALL)[:2]
    named = dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", light))
    if scheme == "dark":
        named |= dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6})", dark))
    return named


def luminance(colour: str) -> float:
    """Return the relative luminance of ``#rrggbb``, as WCAG defines it."""
    parts = [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def contrast(one: str, other: str) -> float:
    """Return the contrast ratio of two colours, 1 to 21."""
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def test_contrast_of_black_on_white_and_of_a_known_grey() -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#767676", "#ffffff") == pytest.approx(4.54, abs=0.01)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_from_what_it_lies_on(scheme: str) -> None:
    named = tokens(scheme)
    ratios = {pair: contrast(named[pair[0]], named[pair[1]]) for pair in PAIRS}
    assert {pair: round(ratio, 2) for pair, ratio in ratios.items() if ratio < AA_SMALL} == {}
