"""Colors: as readable as they promise, and on patients' pages as bright in each theme."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rehab.training.valences import VALENCES

TOKENS = Path(__file__).parents[2] / "static" / "css" / "shared" / "tokens.css"
THEMES = [*VALENCES, "calm"]


def colors_of(*blocks: str) -> dict[str, str]:
    """Return the colors of these blocks, with those that all share, by name: ``"#e2eefe"``."""
    text = TOKENS.read_text()
    bodies = [text.split(f"{block} {{", 1)[1].split("}", 1)[0] for block in (":root", *blocks)]
    return dict(re.findall(r"--(\w[\w-]*): (#[0-9a-f]{6})", "".join(bodies)))


def luminance(color: str) -> float:
    """Return the relative luminance (WCAG 2.2)."""
    shares = [int(color[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [s / 12.92 if s <= 0.04045 else ((s + 0.055) / 1.055) ** 2.4 for s in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    dark, bright = sorted([luminance(one), luminance(other)])
    return (bright + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("theme", THEMES)
def test_words_and_shapes_stand_out(theme: str) -> None:
    color = colors_of(f'[data-theme="{theme}"]')
    for words, behind in [
        ("ink", "sky"),
        ("ink", "ground"),
        ("deep", "ground"),
        ("on-deep", "deep"),
    ]:
        assert contrast(color[words], color[behind]) >= 7, (words, behind)
    for behind in ("tube", "ground"):
        assert contrast(color["fill"], color[behind]) >= 4, behind


def test_no_type_is_brighter_than_another() -> None:
    grounds = [luminance(colors_of(f'[data-theme="{theme}"]')["ground"]) for theme in THEMES]
    assert 0.655 <= min(grounds) <= max(grounds) <= 0.695


@pytest.mark.parametrize(
    "blocks", [[":root,\n[data-pt]"], [":root,\n[data-pt]", '[data-pt="dark"]']]
)
def test_shapes_of_charts_stand_out(blocks: list[str]) -> None:
    color = colors_of(*blocks)
    for shape in ("edge", "c-miss", "c-third", "primary"):  # a hit is primary
        assert contrast(color[shape], color["card"]) >= 3, shape
