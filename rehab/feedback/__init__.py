"""The feedback types of a clinic: points, words, confetti and gestures for each valence."""
