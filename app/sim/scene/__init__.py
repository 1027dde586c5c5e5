"""A cell as kernel arrays."""
