"""The sockets that sources, screens and robots dial in on (docs/protocol.md)."""
