"""What a robot does and says of itself: windows, decisions, safety, status. Time is a parameter."""
