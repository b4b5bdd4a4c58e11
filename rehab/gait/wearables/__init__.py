"""Strides of a sensor on a foot or shank: contacts, times and angles, never a force or power."""

from rehab.gait.wearables.detector import WearableDetector
from rehab.gait.wearables.strides import VERSION, Doubt, Place, WearableStride

__all__ = ["VERSION", "Doubt", "Place", "WearableDetector", "WearableStride"]
