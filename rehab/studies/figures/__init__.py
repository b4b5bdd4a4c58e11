"""Figures of a study's results as SVG: pure, readable in gray and by the color-blind."""
