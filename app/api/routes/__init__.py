"""One router per resource.

aliases         Aliases: names that point to checkpoints
cells           Work cells as data, shipped ones and the user's own
checkpoints     Trained policies: list, read, download, upload
health          Liveness and readiness, for monitors
job_actions     Actions on jobs: cancel, resume, retry, clone, label, delete
jobs            Training and evaluation as jobs: post, list, follow
metrics         Metrics for Prometheus
motion          Motion decisions: the next trajectory segment toward a goal (thesis chapter
                4)
plan            Next move of a sorting task with its motion, by the pick policy's critic
presets         Presets of training jobs, with the limits of every field
recordings      Recordings of human motion: import a file, list, show, remove
reference       ``/docs``: the API description as one static page without external scripts
results         Results of jobs: evaluations; comparison of fields and curves, CSV
risk_map        Choice and risk over a grid of positions of a person
session         Sign-in of a browser: exchanges the token for a session cookie
sorting         Sorting decisions: the next move of a sorting task (thesis chapter 3)
task_selection  Task selection by the critic's values (thesis chapter 5)
trackers        Trackers of key-points, updated frame by frame
viewer          Proxy for the 3D viewer of a world, on the service's port
worlds          Live worlds: their state, their stream, and what may be done to them
"""
