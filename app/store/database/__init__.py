"""The database as a whole: tables, their version, lease, lock, backups.

archive  Archive of a backup: its members, checked by size and SHA-256
backup   Backups of a data folder, also while the server runs
lease    Lease: the right of one server to run the jobs of a database
lock     Lock for one server per data folder and SQLite file
migrate  Creation and upgrade of the tables
reserve  Space reserved in the database, for ends of jobs when it is full
schema   Check of the database's schema, for workers, which never change it
size     Size of the database on its disk
tables   The tables
"""
