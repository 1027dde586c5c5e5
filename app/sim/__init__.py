"""The world: kinematics, human, distances, cells, scenarios. No torch, no web, no database."""
