"""HTTP and WebSocket: application, access control, problems, routes, schemas.

application       The HTTP application: routers, error handlers, access control and the
                  page
bodies            ASGI middleware that checks address and body of a request before its route
compression       Compression of answers for clients that accept it, by ``Accept-Encoding``
                  (RFC 9110)
description       The OpenAPI document: answers of every operation, access, and names of
                  operations
following         Live worlds that follow a training
job_requests      Jobs of requests: the one a path names, checks before one is queued,
                  its answer
direct_routes     ASGI middleware that answers decision routes before the routing
known_people      Conversion of the people of a request to person states
metrics           Metrics for Prometheus that are counted at requests
problems          Errors as problem documents (RFC 9457, ``application/problem+json``)
registry          Cache of loaded policies, and names of stored checkpoints
responses         Outermost ASGI middleware: completes every response
security          Access control: one ASGI middleware around every route, mount and socket
state_metrics     Metrics that are read from the service at a scrape
services          Parts of the service that routes use; ``app.main`` creates them
sockets           Size of WebSocket messages, and refusal of a socket with a reason
texts             Detection of JSON that no route accepts
tracker_sessions  Sessions of trackers: the estimators of people, kept between frames
validation        Conversion of pydantic's validation errors to field, value, rule and
                  choices
world_policies    Policies and recordings that commands to a live world name
motion/           Motion decisions: answers of the route, and sockets for loops with a
                  deadline
routes/           One router per resource
schemas/          Bodies of requests and answers: one pydantic model per direction, units in
                  descriptions
"""
