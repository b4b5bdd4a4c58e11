"""Simulated studies: patients who respond to feedback, with a known effect of each arm."""
