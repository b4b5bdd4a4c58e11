"""One live session: its fold, its rows on their way to the log, its subscribers."""
