"""Work cells as data."""
