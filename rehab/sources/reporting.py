"""How a source reports to the person who runs it: lines of text, and errors that stop it."""

from __future__ import annotations

from collections.abc import Callable

# Called with a line for the person who runs the source.
Notify = Callable[[str], None]


class SourceError(ValueError):
    """A source that cannot run as it was asked to; the message says what would work."""
