"""The browser page and the 3D scene.

page/    Page: static files, without a build step. ``app.js`` is the entry; ``api.js`` sends
         requests, ``action.js`` has buttons that wait for an answer, ``unconfirmed.js`` the
         commands that no snapshot shows yet, ``choice.js`` segmented controls, ``viewmenu.js``
         what the scene shows, ``kept.js`` what the browser keeps, ``plots.js`` charts,
         ``format.js`` numbers and units; ``live/``, ``sorting/``, ``reach/`` and ``training/``
         hold the panels
viewer/  The 3D scene on viser
"""
