"""Live worlds: a work cell that runs in real time, takes commands and gives snapshots.

arm              Robot of a live cell: state, motion of one control period, contact
base_world       Base class of live worlds: clock, people, robot, decisions of the policy,
                 contacts
command_checks   Checks of a command against the work cell and the state of its world
commands         Commands to a live world: one message each, in Python and as JSON
factory          Live world of a cell: sorting, reaching or pick-and-place, by its stations
lateness         Histogram of the lateness of a live world's ticks
playback         Playback of a recorded motion in a cell, in real time
read_model       Base class and array types of snapshots, the JSON of the HTTP API
resting_people   A live robot beside people at rest: blocked targets are left out, and a planner
                 acts
snapshot         Immutable state of a live world at one tick, for any thread and as JSON of the
                 HTTP API
status_messages  Status messages common to the live worlds, and their numbers as text
world_handle     Interface of a live world for other threads: command queue and last snapshot
people/          People of live worlds: workers, pedestrians, dragged people
pick/            The live pick-and-place world
reach/           The live reach world
safety/          The safety layer of live worlds
sorting/         The live sorting world
"""
