"""What therapists fill in: a session's set-up, a preset of it, a correction."""
