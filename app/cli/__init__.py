"""The command line, ``python -m app COMMAND``.

A command imports the modules it needs when it runs, so that ``--help`` is quick.

backup          The commands ``backup`` and ``restore``
cells           The command group ``cells``: list, show, check, add and remove work cells
database        The database as commands open it, beside a running server or without one
entry           The Typer application and its entry point
export          The command ``export``: write a checkpoint as an ONNX model
evaluate        The commands ``evaluate`` and ``bench``
http_limits     Limits of HTTP connections: size of the request head, time, progress, number of
                clients
joined_head     Answers in one write: the head of an answer leaves with the first part of its
                body
options         Options that several commands have, and the environment that every command
                prepares
output          Printing of results, as text or as one JSON object
preflight       Checks before the server loads anything else: its port and its database are
                unused
recordings      The command group ``recordings``: import, list, show and remove recorded human
                motion
report          The command ``report``: tables and figures of the thesis beside the results
report_job      The report whose evaluations a running server measures again
serve           The commands ``serve`` and ``setup``
socket_limits   Limits of WebSocket connections: time for a client that does not read
train           The command ``train``: train a policy in this process, without a server
uvicorn_server  The application on uvicorn: one process, one worker, a quick end
"""
