"""The process that owns a serial port, and its client."""
