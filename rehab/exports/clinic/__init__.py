"""A clinic as a unit: taken out as one sealed file, in elsewhere, compared, and removed."""
