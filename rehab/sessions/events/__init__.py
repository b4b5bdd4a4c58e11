"""The events of a live session as messages for each audience. Pure: nothing is sent here."""
