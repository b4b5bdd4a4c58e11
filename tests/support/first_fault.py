"""The state machine of sources as a detector's test needs it: it ends with the first fault."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from hypothesis.stateful import invariant

from rehab.sessions.live.database.trouble import NotStored
from tests.support.source_machine import Sources


class Found(BaseException):  # Hypothesis lets through what is no Exception
    """A machine has found a fault."""

    def __init__(self, fault: Exception) -> None:
        super().__init__(fault)
        self.fault = fault


class FirstFault(Sources):
    """The same machine, which ends the test with the first fault that it finds.

    Whether a seeded fault shows depends on how far the server's threads are, as real ones do.
    Hypothesis would try the same example again, and call it flaky if the fault did not show.
    """

    def __init__(self) -> None:
        super().__init__()
        self.found: Found | None = None

    def go(self, work: Any) -> Any:
        with self._ending():
            return super().go(work)

    @invariant()
    def the_source_is_still_welcome(self) -> None:
        with self._ending():
            super().the_source_is_still_welcome()

    @contextmanager
    def _ending(self) -> Iterator[None]:
        """End the test with what fails inside."""
        try:
            yield
        except (AssertionError, TimeoutError, NotStored) as fault:  # HungUp is an assertion, too
            self.found = self.found or Found(fault)
            raise self.found from fault

    def teardown(self) -> None:
        """Look at the log, unless there is a fault already."""
        if self.found is not None:
            del self.session
        super().teardown()
