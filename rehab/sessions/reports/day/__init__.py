"""A clinic today and this week."""
