"""HTTP and WebSocket: one router per noun, schemas, problems, security, the viewer proxy.

answers           Outermost ASGI layer: completes every answer
application       The HTTP application: routers, error handlers, access control and the page
bodies            ASGI layer that checks address and body of a request before its route
cells             Work cells as data, shipped ones and the user's own
checkpoints       Trained policies: list, read, download
health            Liveness and readiness, for monitors
jobs              Training and evaluation as jobs: post, list, cancel, follow
known_people      Conversion of the people of a request to person states
motion            Motion decisions: the next trajectory segment toward a goal (thesis chapter
                  4)
presets           Presets of training jobs, with the limits of every field
problems          Errors as problem documents (RFC 9457, ``application/problem+json``)
recordings        Recordings of human motion: import a file, list, show, remove
reference         ``/docs``: the API description as one static page without external scripts
registry          Cache of loaded policies, and names of stored checkpoints
security          Access control: one ASGI layer around every route, mount and socket
services          Parts of the service that routes use; ``app.main`` creates them
session           Sign-in of a browser: exchanges the token for a session cookie
sockets           Refusal of a WebSocket with a reason
sorting           Sorting decisions: the next move of a sorting task (thesis chapter 3)
task_selection    Task selection by the critic's values (thesis chapter 5)
texts             Detection of JSON that no route accepts
tracker_sessions  Sessions of trackers: the estimators of people, kept between frames
trackers          Trackers of key-points, updated frame by frame
validation        Conversion of pydantic's validation errors to field, value, rule and choices
viewer            Proxy for the 3D viewer of a world, on the service's port
world_policies    Policies and recordings that commands to a live world name
worlds            Live worlds: their state, their stream, and what may be done to them
schemas/          What goes over the wire: one pydantic model per direction, units in the
                  descriptions
"""
