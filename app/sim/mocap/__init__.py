"""Import of recorded human motion."""
