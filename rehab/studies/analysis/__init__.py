"""What a study found: outcomes of sessions, curves, and differences between arms. Pure."""
