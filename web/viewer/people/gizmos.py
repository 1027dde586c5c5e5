"""Handles by which a visitor drags pelvis and hands of a person in manual mode.

Callbacks run on viser's event loop and only queue a command. A gizmo that is not held follows
its body part and so shows the reached position.
"""

import time
from collections.abc import Callable

import numpy as np
import viser

from app.live.commands import MovePerson
from app.live.snapshot import PersonSnapshot
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.perception.keypoints import FARTHEST_M
from web.viewer.poses import upright, yaw_of

HANDS = {"right": "hand_r", "left": "hand_l"}
SETTLE_S = 0.6
"""Time for which a released gizmo stays where it was released [s]."""
HOLD_S = 5.0
"""Time without motion after which a held gizmo counts as released [s]."""


class Gizmos:
    """Gizmos of one person; poses are written by the live cell's thread only.

    Args:
        jointed: Whether the person has hands and a yaw (a worker).
    """

    def __init__(
        self,
        server: viser.ViserServer,
        person: int,
        submit: Callable[[MovePerson], object],
        *,
        jointed: bool = True,
    ) -> None:
        self._person, self._submit = person, submit
        scene, root = server.scene, f"/gizmos/{person}"
        self._frame = scene.add_frame(root, show_axes=False)
        self._free_at: dict[str, float] = {}
        self._pelvis = scene.add_transform_controls(
            f"{root}/pelvis",
            scale=0.34,
            line_width=3.0,
            active_axes=(True, True, False),
            disable_rotations=not jointed,
            depth_test=False,
            opacity=0.9,
            visible=False,
        )
        self._hands = {
            name: scene.add_transform_controls(
                f"{root}/{name}",
                scale=0.2,
                line_width=2.5,
                disable_rotations=True,
                depth_test=False,
                opacity=0.9,
                visible=False,
            )
            for name in (HANDS if jointed else ())
        }
        self._listen()

    def _listen(self) -> None:
        @self._pelvis.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            self._free_at["pelvis"] = release_time(event.phase)
            x, y, _ = clipped(self._pelvis.position)
            self._submit(
                MovePerson(person=self._person, pelvis=(x, y, yaw_of(self._pelvis.wxyz)))
            )

        for name, gizmo in self._hands.items():
            self._listen_to_hand(name, gizmo)

    def _listen_to_hand(self, name: str, gizmo: viser.TransformControlsHandle) -> None:
        @gizmo.on_update
        async def _(event: viser.TransformControlsEvent) -> None:
            self._free_at[name] = release_time(event.phase)
            point = clipped(gizmo.position)
            if name == "right":
                self._submit(MovePerson(person=self._person, right=point))
            else:
                self._submit(MovePerson(person=self._person, left=point))

    def _free(self, name: str) -> bool:
        return time.monotonic() >= self._free_at.get(name, 0.0)

    def remove(self) -> None:
        """Remove the gizmos from the scene."""
        self._frame.remove()

    def draw(self, person: PersonSnapshot) -> None:
        """Show the gizmos in manual mode, each at its body part."""
        manual = person.mode == "manual"
        for gizmo in (self._pelvis, *self._hands.values()):
            gizmo.visible = manual
        if not manual:
            self._free_at.clear()
            return
        points = human.joint_points(person.posture, person.size)
        if self._free("pelvis"):
            move(self._pelvis, points["pelvis"], upright(float(person.posture[2])))
        for name, gizmo in self._hands.items():
            if self._free(name):
                move(gizmo, points[HANDS[name]])


def release_time(phase: str) -> float:
    """Return the time of the monotonic clock [s] from which a dragged gizmo is free again."""
    return time.monotonic() + (SETTLE_S if phase == "end" else HOLD_S)


def clipped(
    position: Vec, low: Vec | float = -FARTHEST_M, high: Vec | float = FARTHEST_M
) -> tuple[float, float, float]:
    """Return the nearest position that a command accepts [m].

    A gizmo that is dragged toward the horizon is kilometres away.
    """
    x, y, z = np.clip(position, low, high).tolist()
    return x, y, z


def move(gizmo: viser.TransformControlsHandle, position: Vec, wxyz: Vec | None = None) -> None:
    """Move a gizmo that is not held; sends nothing where it is there already."""
    if np.abs(gizmo.position - position).max() > 1e-3:
        gizmo.position = position
    if wxyz is not None and np.abs(gizmo.wxyz - wxyz).max() > 1e-3:
        gizmo.wxyz = wxyz
