"""One contact of a foot with the floor."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(slots=True, eq=False)
class Contact:
    """One contact of a foot with its plate. Indices count samples since the start.

    Attributes
    ----------
    begin_index, begin_s, end_index, end_s
        When the foot met and left the floor; None until it left.
    offset_n
        What the plate read in the swing before [N].
    is_onset_seen
        Whether its beginning was observed (not so at the start of the record or after a loss).
    is_bounce
        Whether it only continues the stance before it.
    peak_n
        Largest force above the offset [N], once the contact has ended.
    known_index
        The sample at which it was known that the contact has ended.
    """

    begin_index: int
    begin_s: float
    offset_n: float
    is_onset_seen: bool
    is_bounce: bool
    end_index: int | None = None
    end_s: float | None = None
    peak_n: float = 0.0
    known_index: int | None = None

    @property
    def end(self) -> float:
        """The index at which the foot left; infinite until then."""
        return math.inf if self.end_index is None else self.end_index
