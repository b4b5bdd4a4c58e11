"""Allocation of participants to groups: pure, and the same for the same seed anywhere."""
