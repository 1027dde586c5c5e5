"""The viewer's own small panel: what is shown over the scene.

Modes, clock, cases and checkpoints belong to the page around the viewer; here is only what
concerns the picture.
"""

import viser

from web.scene import Overlays

BRAND = (11, 127, 119)


def build(server: viser.ViserServer, overlays: Overlays) -> None:
    """Add the panel; its boxes write ``overlays``, which the drawing thread reads."""
    gui = server.gui
    gui.configure_theme(
        show_logo=False, show_share_button=False, brand_color=BRAND, control_width="small"
    )
    gui.set_panel_label("View")
    gui.main_panel.minimize()
    shapes = gui.add_checkbox(
        "Collision shapes",
        overlays.shapes,
        hint="The capsules with which the simulator measures distances.",
    )
    values = gui.add_checkbox(
        "Values", overlays.values, hint="What the critic expects at each candidate."
    )
    path = gui.add_checkbox(
        "Target line", overlays.path, hint="From the tool to the chosen candidate."
    )

    @shapes.on_update
    async def _(_: object) -> None:
        overlays.shapes = shapes.value

    @values.on_update
    async def _(_: object) -> None:
        overlays.values = values.value

    @path.on_update
    async def _(_: object) -> None:
        overlays.path = path.value
