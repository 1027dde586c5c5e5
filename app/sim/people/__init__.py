"""Motion of people in the cell."""
