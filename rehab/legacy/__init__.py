"""Import from the original GARRY, and the API routes of its paper."""
