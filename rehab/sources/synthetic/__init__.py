"""Synthetic walkers: strides that vary, are learned, tire and fail as recorded ones do."""

from rehab.sources.synthetic.profiles import GOOD, PROFILES, WalkerProfile
from rehab.sources.synthetic.walker import SyntheticWalker, walk

__all__ = ["GOOD", "PROFILES", "SyntheticWalker", "WalkerProfile", "walk"]
