"""A study's results: read from the logs, told to who may look, and drawn."""
