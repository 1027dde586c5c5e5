"""The browser page and the 3D scene.

page/    Page: static files, without a build step
viewer/  The 3D scene on viser
"""
