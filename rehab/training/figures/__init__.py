"""What a session adds up to."""
