"""A study's results: read from the logs, shown to those who may look, and drawn."""
