"""The database: jobs, curves, events, checkpoints; the only package with SQL.

engine       The connection to the database: SQLite by default, PostgreSQL by URL
database/    The database as a whole: tables, their version, lease, lock, backups
attempts     Writes of a running attempt: its claim, heartbeats, progress, checkpoints
cells        Work cells of the user's own, as JSON under a name; the store never opens them
checkpoints  Trained policies and their aliases
completion   Ends of attempts: succeeded, cancelled, failed, crashed, interrupted, orphaned
composed_jobs
             Jobs made of jobs: sweeps and reports
cursors      Pages of lists, and their cursors: opaque text with the number of the last item
events       Events of jobs, the source of event streams
fencing      Fencing of writes about a running job by its attempt number
job_actions  Actions on jobs beside cancel: resume, name, notes, priority
jobs         Jobs: submit, read, cancel
metrics      Learning curves of jobs: one row per step
recordings   Imported human motion, as bytes under a name; the store never opens them
records      Data types of the store: frozen dataclasses, no database rows
references   References of jobs: stored when a job is queued, kept until it has ended
retention    Removal of checkpoints, ended jobs and states: on request, beyond a number to keep
migrations/  Alembic's scripts: one file per change of the tables
"""
