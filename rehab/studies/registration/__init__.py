"""Registering a study: its document, its sealed secret, and its way from plan to end."""
