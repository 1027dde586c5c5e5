"""One router per resource.

aliases         Aliases: names that point to checkpoints
attempts        Jobs of workers on other machines: read, report, end
cells           Work cells as data, shipped ones and the user's own
checkpoints     Trained policies: list, read, download, upload
decisions/      Decisions: task selection, sorting moves, motion, both at once, risk map
health          Liveness, readiness and metrics, for monitors
job_actions     Actions on jobs: cancel, resume, retry, clone, label, delete
jobs            Training and evaluation as jobs: post, list, follow
presets         Presets of training jobs, with the limits of every field
protocols       Protocols of evaluations, with the inputs of each
recordings      Recordings of human motion: import a file, list, show, remove
reference       ``/docs``: the API description as one static page without external scripts
results         Results of jobs: evaluations; comparison of fields and curves, CSV
session         Sign-in of a browser: exchanges the token for a session cookie
trackers        Trackers of key-points, updated frame by frame
viewer          Proxy for the 3D viewer of a world, on the service's port
worlds          Live worlds: state, stream and commands
"""
