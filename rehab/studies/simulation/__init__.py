"""Simulated studies: patients that answer feedback, with an effect of each arm put in."""
