"""Checks of a lab's signals, with what to put right, and of the lag between its clocks."""
