"""The pages of sessions, one module each."""
