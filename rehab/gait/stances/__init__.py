"""One stance at a time: resampled, checked, and its push-off measured."""
