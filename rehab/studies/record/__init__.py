"""The record of a trial: what is asked of it, its checklists, adverse events."""
