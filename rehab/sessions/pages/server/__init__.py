"""Pages that tell programs how the server is."""
