"""The frames of docs/protocol.md: read, checked, put together."""
