"""Tallies: running sums over scored steps, from which figures and metrics are computed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from rehab.training.steps import InvalidReason, ScoredStep

STRIDES = ("strides", "valid", "invalid", "missing", "late")  # all, and of what kind they are


@dataclass(slots=True)
class Tally:
    """Counts and sums over steps of the trained leg.

    ``strides = valid + invalid + missing + late``. A streak is a run of hits among judged steps: an
    invalid stride and a close step neither break nor extend it.

    Attributes
    ----------
    strides, valid, invalid, missing, late
        A missing stride had no value and no other fault; a late one's samples came late from the
        lab, which is no fault of the walker's.
    judged, hits, points
        ``judged`` counts valid steps for which a goal was known, ``hits`` those at the goal that
        were not close.
    value_sum, performance_sum
        Of the valid and of the judged steps.
    value_squares
        Sum of the valid values' squared deviations from their mean (Welford 1962).
    close
        Judged steps that were close, hits or not.
    streak, best_streak
        The run of hits that is under way, and the longest one.
    """

    strides: int = 0
    valid: int = 0
    invalid: int = 0
    missing: int = 0
    judged: int = 0
    hits: int = 0
    value_sum: float = 0.0
    performance_sum: float = 0.0
    points: int = 0
    streak: int = 0
    best_streak: int = 0
    value_squares: float = 0.0
    close: int = 0
    late: int = 0

    def add(self, step: ScoredStep) -> None:
        """Count one more step. An invalid one only adds to the counts of strides."""
        self.strides += 1
        if not step.valid:
            if step.reasons == (InvalidReason.MISSING,):
                self.missing += 1
            elif InvalidReason.LATE in step.reasons:
                self.late += 1
            else:
                self.invalid += 1
            return
        value = step.value or 0.0
        if self.valid:
            deviation = value - self.value_sum / self.valid
            self.value_squares += deviation * deviation * self.valid / (self.valid + 1)
        self.valid += 1
        self.value_sum += value
        self.points += step.points or 0
        if step.performance is None:
            return
        self.judged += 1
        self.performance_sum += step.performance
        if step.close:
            self.close += 1
        elif step.hit:
            self.hits += 1
            self.streak += 1
            if self.streak > self.best_streak:
                self.best_streak = self.streak
        else:
            self.streak = 0

    def merge(self, other: Tally) -> None:
        """Add the sums of another tally; no streak continues from one to the other."""
        if self.valid and other.valid:  # Chan, Golub & LeVeque 1983
            apart = other.value_sum / other.valid - self.value_sum / self.valid
            share = self.valid * other.valid / (self.valid + other.valid)
            self.value_squares += apart * apart * share
        self.value_squares += other.value_squares
        for name in (*STRIDES, "judged", "hits", "close", "points"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.value_sum += other.value_sum
        self.performance_sum += other.performance_sum
        self.streak = other.streak
        self.best_streak = max(self.best_streak, other.best_streak)

    @property
    def mean_value(self) -> float | None:
        """Mean of the valid values, in the measure's unit."""
        return self.value_sum / self.valid if self.valid else None

    @property
    def sd_value(self) -> float | None:
        """Sample SD of the valid values, in the measure's unit; None of fewer than two."""
        return math.sqrt(self.value_squares / (self.valid - 1)) if self.valid > 1 else None

    @property
    def mean_performance(self) -> float | None:
        """Mean performance of the judged steps (ratio)."""
        return self.performance_sum / self.judged if self.judged else None

    @property
    def hit_rate(self) -> float | None:
        """Hits among the judged steps that were not close (ratio)."""
        return self.hits / self.decided if self.decided else None

    @property
    def decided(self) -> int:
        """Judged steps that were not close."""
        return self.judged - self.close


class Block(NamedTuple):
    """What was constant while some strides of a phase were walked.

    Attributes
    ----------
    phase
        Index of the phase.
    gain
        Display gain (ratio).
    valence
        Slug of the valence; empty without feedback.
    """

    phase: int
    gain: float
    valence: str
