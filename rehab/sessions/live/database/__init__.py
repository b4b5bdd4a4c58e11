"""What a process has of the database: a connection, a lease, its sessions; and what ails it."""
