"""Several servers on one database: what they ask each other for, whose sessions they follow."""
