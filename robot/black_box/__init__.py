"""Records what a robot received, ordered, did and sent, so that a stop can be looked at later."""
