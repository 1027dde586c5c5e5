"""The viewer's own small panel: what is shown over the scene.

Modes, clock, cases and checkpoints belong to the page around the viewer; here is only what
concerns the picture.
"""

import viser

from app.sim.cells import Cell
from app.sim.reach_commands import is_reaching
from web.scene import Overlays
from web.sorting_scene import sorts

BRAND = (11, 127, 119)


def build(server: viser.ViserServer, overlays: Overlays, cell: Cell) -> None:
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

    @shapes.on_update
    async def _(_: object) -> None:
        overlays.shapes = shapes.value

    if sorts(cell):
        _build_sorting(server, overlays)
    elif is_reaching(cell):
        _build_reach(server, overlays)
    else:
        _build_choice(server, overlays)


def _build_choice(server: viser.ViserServer, overlays: Overlays) -> None:
    values = server.gui.add_checkbox(
        "Values", overlays.values, hint="What the critic expects at each candidate."
    )
    path = server.gui.add_checkbox(
        "Target line", overlays.path, hint="From the tool to the chosen candidate."
    )

    @values.on_update
    async def _(_: object) -> None:
        overlays.values = values.value

    @path.on_update
    async def _(_: object) -> None:
        overlays.path = path.value


def _build_reach(server: viser.ViserServer, overlays: Overlays) -> None:
    zone = server.gui.add_checkbox(
        "Separation zone",
        overlays.zone,
        hint="Where a person is nearer than the rule asks for.",
    )
    trail = server.gui.add_checkbox("Trail", overlays.trail, hint="Where the tool has been.")
    targets = server.gui.add_checkbox(
        "Targets", overlays.targets, hint="The goals that policies are trained on."
    )

    @zone.on_update
    async def _(_: object) -> None:
        overlays.zone = zone.value

    @trail.on_update
    async def _(_: object) -> None:
        overlays.trail = trail.value

    @targets.on_update
    async def _(_: object) -> None:
        overlays.targets = targets.value


def _build_sorting(server: viser.ViserServer, overlays: Overlays) -> None:
    chances = server.gui.add_checkbox(
        "Failure figures", overlays.chances, hint="How often a grasp fails in each cell."
    )
    ghosts = server.gui.add_checkbox(
        "Goal", overlays.ghosts, hint="The blocks that the towers still lack."
    )
    path = server.gui.add_checkbox(
        "Move", overlays.path, hint="From where the block is taken to where it goes."
    )

    @chances.on_update
    async def _(_: object) -> None:
        overlays.chances = chances.value

    @ghosts.on_update
    async def _(_: object) -> None:
        overlays.ghosts = ghosts.value

    @path.on_update
    async def _(_: object) -> None:
        overlays.path = path.value
