"""Texts by which a test finds whose row it sees."""

from __future__ import annotations

from django.db.models import Model


def mark(clinic: str, model: type[Model]) -> str:
    """Return the text that marks a clinic's rows of a model, and stands nowhere else."""
    return f"zq{clinic}{model.__name__.lower()}qz"
