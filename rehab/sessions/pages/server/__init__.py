"""Pages about the server's state, for programs."""
