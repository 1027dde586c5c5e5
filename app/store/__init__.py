"""The database: jobs, curves, events, checkpoints. The only SQL of the project lives here.

attempts     Writes of a running attempt: its claim, heartbeats, progress, checkpoints
backup       Backups of a data folder, also while the server runs
cells        Work cells of the user's own, as JSON under a name; the store never opens them
checkpoints  Trained policies and their aliases
completion   Ends of attempts: succeeded, cancelled, failed, crashed, interrupted, orphaned
cursors      Cursors of lists: opaque text with the number of the last item of a page
engine       The connection to the database: SQLite by default, PostgreSQL by URL
events       Events of jobs, the source of event streams
fencing      Fencing of writes about a running job by its attempt number
job_actions  Actions on jobs beside cancel: resume, name, notes, priority
jobs         Jobs: submit, read, cancel
lease        Lease: the right of one server to run the jobs of a database
lock         Lock for one server per data folder and SQLite file
metrics      Learning curves of jobs: one row per step
migrate      Creation and upgrade of the tables
recordings   Imported human motion, as bytes under a name; the store never opens them
records      Data types of the store: frozen dataclasses, no database rows
reserve      Space reserved in the database, for ends of jobs when it is full
retention    Removal of ended jobs and states: on request, and beyond the numbers to keep
schema       Check of the database's schema, for workers, which never change it
tables       The tables
migrations/  Alembic's scripts: one file per change of the tables
"""
