"""Training configurations (presets)."""
