"""https in a clinic's own network, with a certificate of its own authority or of a real name."""
