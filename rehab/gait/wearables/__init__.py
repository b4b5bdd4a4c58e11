"""Strides of a sensor on a foot or shank: contacts, times and angles, never a force or power."""

from rehab.gait.wearables.strides import VERSION, Doubt, Place

__all__ = ["VERSION", "Doubt", "Place"]
