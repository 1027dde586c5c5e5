"""Training and evaluation as jobs: specs, supervisor, executors and the one entry point."""
