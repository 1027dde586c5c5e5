"""Live worlds: a work cell that runs in real time, takes commands and gives snapshots."""
