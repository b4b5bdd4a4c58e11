"""The start list, and the pages about one patient."""
