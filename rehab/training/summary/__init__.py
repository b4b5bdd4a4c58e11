"""What a session adds up to: its metrics and its summary."""
