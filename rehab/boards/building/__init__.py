"""Storing the rows of boards and keeping them up to date."""
