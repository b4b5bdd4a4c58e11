"""What sessions are set up from: protocols, presets, gestures and sources."""
