"""What other systems are told: stored with what it reports, and sent until it is received."""
