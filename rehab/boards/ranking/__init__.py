"""Ranking: which sessions count, what they come to, and which rows are shown."""
