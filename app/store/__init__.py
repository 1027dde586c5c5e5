"""The database: jobs, curves, events, checkpoints. The only SQL of the project lives here."""
