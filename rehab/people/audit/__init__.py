"""The audit log, the access log of pages and calls, and the change history."""
