"""What a lab's columns are: proposed from half a minute of walking, for a person to confirm."""
