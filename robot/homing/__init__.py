"""Home again by a tag: what a camera sees of it, where the base is then, and the way home."""
