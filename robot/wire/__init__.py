"""What server, sources and robot share of the wire protocol. Standard library only."""
