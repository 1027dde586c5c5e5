"""Reading and checking work cells."""
