"""The pages of the start list, of visits and of records."""
