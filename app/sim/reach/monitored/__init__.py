"""The reach scenario under speed and separation monitoring."""
