"""Stations, their devices, and the pairing of tablets."""
