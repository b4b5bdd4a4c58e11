"""What a robot does and reports: windows, decisions, safety, status. Time is a parameter."""
