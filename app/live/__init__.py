"""Live worlds: a work cell that runs in real time, takes commands and gives snapshots.

arm             The robot of a live cell: where it is, how it moves, what it touches
base_world      Base class of live worlds: clock, people, robot, decisions of the policy,
                contacts
command_checks  Checks of a command against the work cell and the state of its world
commands        Commands to a live world: one message each, in Python and as JSON
factory         Live world of a cell: sorting, reaching or pick-and-place, by its stations
playback        A recorded motion, played in a cell at the pace it was recorded
read_model      Base class and array type of snapshots, which are also the JSON of the HTTP API
snapshot        Immutable state of a live world at one tick, for any thread and as JSON of the
                HTTP API
world_handle    Interface of a live world for other threads: command queue and last snapshot
people/         People of live worlds: workers, pedestrians, dragged people
pick/           The live pick-and-place world
reach/          The live reach world
sorting/        The live sorting world
"""
