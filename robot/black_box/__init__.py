"""Records what a robot heard, ordered, did and said, so that a stop can be looked at later."""
