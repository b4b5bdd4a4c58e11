"""How long samples of a force may wait for others before they are looked at.

A chunk costs as much to look at as two hundred samples do. While a foot swings, has just landed or
still stands, no valid stance can end, and a look at the newest sample tells as much.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Patience:
    """Until when no valid stance can have ended in samples that wait.

    Only a foot that leaves and lands again within one chunk is told later, by the longest wait.

    Attributes
    ----------
    young
        For so many samples a foot that swings, or has just landed, need not be looked at.
    certain_n
        The force above which a contact is certain [N].
    is_standing
        Whether there is one.
    low, free_n
        For so many samples a foot that stands may bear less, down to this force [N].
    """

    young: int
    certain_n: float
    is_standing: bool
    low: int = 0
    free_n: float = 0.0

    def lasts(self, count: int, newest_n: float) -> bool:
        """Return whether ``count`` samples may wait, the newest force of which is given [N]."""
        if count <= self.young:
            return True
        if not self.is_standing:
            return newest_n <= self.certain_n
        return newest_n >= self.certain_n or (count <= self.low and newest_n >= self.free_n)
