"""Motion of a base: twists, poses, limits, paths, gestures and the player. Pure."""
