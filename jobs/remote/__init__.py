"""Jobs on other machines: workers reach their job by the routes of the service, over HTTP.

access      Access of a worker to its job by the service
connection  Requests of a worker to the service; problems become the errors of the store
inputs      Inputs of a job from the service
ray_driver  One attempt on a Ray cluster: the process beside the server
ray_node    The process of one attempt on a node of a Ray cluster: an actor that starts it
run         Entry point of a job's process: ``python -m jobs.remote.run --job ID --attempt N``
uploads     Checkpoints and states of workers on other machines, checked before storing
"""
