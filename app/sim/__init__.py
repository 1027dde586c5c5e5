"""The world: kinematics, human, distances, cells and scenarios. No torch, no web, no database."""
