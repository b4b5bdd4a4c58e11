"""When a foot meets and leaves the floor: from force plates."""
