"""Gestures that a clinic composes for its robots."""
