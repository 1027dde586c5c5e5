"""The 18-DoF human model."""
