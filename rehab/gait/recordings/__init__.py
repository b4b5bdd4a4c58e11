"""Recorded signals in CSV files: their columns, how they are read and drawn."""
