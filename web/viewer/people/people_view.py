"""All people in the scene, created when they enter and hidden when they leave."""

from collections.abc import Callable

import viser

from app.live.commands import MovePerson
from app.live.snapshot import PersonSnapshot, WorldSnapshot
from app.sim.cells.cell import Cell
from web.viewer.people.gizmos import Gizmos
from web.viewer.people.person_view import PersonView


class PeopleView:
    """Draws all people with their handles; used by the live cell's thread only."""

    def __init__(
        self, server: viser.ViserServer, cell: Cell, submit: Callable[[MovePerson], object]
    ) -> None:
        self._server, self._cell, self._submit = server, cell, submit
        self._drawn: dict[int, tuple[PersonView, Gizmos]] = {}
        # Those of people who have left: their meshes must not be removed, see PersonView.
        self._hidden: dict[int, PersonView] = {}

    def draw(self, snapshot: WorldSnapshot, dt: float, *, shapes: bool) -> None:
        """Show the people of a snapshot, ``dt`` [s] after the last one.

        With ``shapes`` their collision capsules are shown.
        """
        here = {person.id for person in snapshot.people}
        for id in self._drawn.keys() - here:
            view, gizmos = self._drawn.pop(id)
            view.hide()
            gizmos.remove()
            self._hidden[id] = view
        contact = snapshot.contact if snapshot.status == "contact" else None
        for person in snapshot.people:
            if person.id not in self._drawn:
                self._drawn[person.id] = self._add(person)
            view, gizmos = self._drawn[person.id]
            view.draw(person, dt)
            touched = contact is not None and contact.person == person.id
            view.capsules.show(shapes, (contact.body,) if contact and touched else ())
            gizmos.draw(person)

    def _add(self, person: PersonSnapshot) -> tuple[PersonView, Gizmos]:
        """Show a person that was absent at the last call."""
        view = self._hidden.pop(person.id, None)
        if view is None:
            view = PersonView(self._server, self._cell, person)
        else:
            view.show(person)
        jointed = person.cylinder is None
        return view, Gizmos(self._server, person.id, self._submit, jointed=jointed)
