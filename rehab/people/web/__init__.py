"""What the pages, the admin and the API of all rooms share."""
