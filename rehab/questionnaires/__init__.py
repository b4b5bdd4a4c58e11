"""Questionnaires: their items, scales and scores. Pure: no framework, no input or output."""
