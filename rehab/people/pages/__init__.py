"""Pages about people: the front page, coming in, the own account."""
