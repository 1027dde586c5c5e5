"""Parts of the scene that each visitor can show or hide in one browser.

Every part that can be hidden has a node. A setting is a check box of one visitor's connection
and hides the node in the scene of this visitor only. The panel of viser is never shown: the
page has the same check boxes and sets those of viser (``viewer_extra.html``).
"""

from dataclasses import dataclass

import viser

from app.live.reach.commands import is_reaching
from app.sim.cells.cell import Cell
from app.sim.sorting.layout import is_sorting
from web.viewer.capsules_view import SHAPES
from web.viewer.scene.risk_view import NODE as RISK

PREFIX = "view: "
"""Prefix of the labels of these check boxes, by which the page finds them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """A part of the scene that can be shown or hidden."""

    label: str
    """Label for display."""
    node: str
    """Node in the scene."""
    shown: bool = True
    """Whether it is shown initially."""


COLLISION_SHAPES = Setting(label="Collision shapes", node=SHAPES, shown=False)
RISK_MAP = Setting(label="Risk map", node=RISK, shown=False)
CHOICE = (
    Setting(label="Values", node="/labels"),
    Setting(label="Target line", node="/path"),
    RISK_MAP,
)
SORTING = (
    Setting(label="Failure probabilities", node="/chances"),
    Setting(label="Goal", node="/goal"),
    Setting(label="Move", node="/move"),
)
REACH = (
    Setting(label="Separation zone", node="/zone"),
    Setting(label="Trail", node="/trail"),
    Setting(label="Targets", node="/goals"),
)


def settings_of(cell: Cell) -> tuple[Setting, ...]:
    """Return the parts of a cell's scene that can be shown or hidden."""
    if is_sorting(cell):
        return (COLLISION_SHAPES, *SORTING)
    return (COLLISION_SHAPES, *(REACH if is_reaching(cell) else CHOICE))


class ViewSettings:
    """Check boxes of every visitor; an unchecked part is hidden for that visitor."""

    def __init__(self, server: viser.ViserServer, cell: Cell) -> None:
        self._settings = settings_of(cell)
        self._seen_by: dict[Setting, set[int]] = {one: set() for one in self._settings}
        server.gui.configure_theme(show_logo=False, show_share_button=False)
        for one in self._settings:
            server.scene.add_frame(one.node, show_axes=False, visible=one.shown)
        server.on_client_connect(self._greet)
        server.on_client_disconnect(self._forget)

    def is_seen(self, setting: Setting) -> bool:
        """Whether any visitor shows it."""
        return bool(self._seen_by.get(setting))

    async def _greet(self, visitor: viser.ClientHandle) -> None:
        for one in self._settings:
            self._add_box(visitor, one)

    async def _forget(self, visitor: viser.ClientHandle) -> None:
        for seen_by in self._seen_by.values():
            seen_by.discard(visitor.client_id)

    def _add_box(self, visitor: viser.ClientHandle, setting: Setting) -> None:
        seen_by, id = self._seen_by[setting], visitor.client_id
        box = visitor.gui.add_checkbox(f"{PREFIX}{setting.label}", setting.shown)
        if setting.shown:
            seen_by.add(id)

        @box.on_update
        async def _(_: object) -> None:
            (seen_by.add if box.value else seen_by.discard)(id)
            # Replaces the shared node of that name in the scene of this visitor.
            visitor.scene.add_frame(setting.node, show_axes=False, visible=box.value)
