"""Exports of data, and backups of a whole installation."""
