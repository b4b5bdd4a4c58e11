"""Synthetic walkers: strides that vary, are learned, tire and fail as recorded ones do."""

from rehab.sources.synthetic.profiles import (
    ANSWERS,
    GOOD,
    PROFILES,
    FeedbackResponse,
    WalkerProfile,
)
from rehab.sources.synthetic.walker import SyntheticWalker, walk

__all__ = [
    "ANSWERS",
    "GOOD",
    "PROFILES",
    "FeedbackResponse",
    "SyntheticWalker",
    "WalkerProfile",
    "walk",
]
