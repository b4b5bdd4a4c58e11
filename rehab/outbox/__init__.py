"""What other systems are notified of: stored with what it reports, sent until it is received."""
