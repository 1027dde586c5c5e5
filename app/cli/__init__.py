"""The command line, ``python -m app COMMAND``.

* ``entry``: the Typer application and ``main``
* ``serve``: ``serve`` and ``setup``; ``preflight`` checks port and database beforehand,
  ``uvicorn_server`` runs the application
* ``train``, ``evaluate`` (and ``bench``), ``cells``, ``recordings``: the other commands
* ``options``, ``output``, ``database``: shared options, printing, access to the database

A command imports the modules it needs when it runs, so that ``--help`` is quick.
"""
