"""Samples as they come: chunks, the buffer of the last seconds, filters."""
