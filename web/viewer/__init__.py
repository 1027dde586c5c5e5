"""The 3D scene on viser."""
