"""How long samples of a force may wait for others before they are looked at.

To look at a chunk costs as much as hundreds of samples do. While a foot swings, has just landed or
still stands, no valid stance can have ended, and its newest sample shows which.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from rehab.gait.signals.filters import Floats, find_minimum


@dataclass(slots=True, kw_only=True)
class ChunkWait:
    """While no valid stance can have ended in samples that wait.

    Only a foot that leaves and lands again within one chunk is reported later, by the longest wait.

    Attributes
    ----------
    least_n, most_n
        Between these forces the foot goes on with what it does: it swings, or stands [N].
    young
        For so many samples it may bear anything, as the next stance has not begun or is young.
    low, free_n
        For so many samples it may bear less, down to this force [N], as a foot that soon leaves.
    """

    least_n: float = -math.inf
    most_n: float = math.inf
    young: int
    low: int = 0
    free_n: float = math.inf

    def lasts(self, count: int, force: Floats) -> bool:
        """Return whether ``count`` samples [N] of a foot that changes what it does may wait."""
        return count <= self.young or (count <= self.low and find_minimum(force) >= self.free_n)
