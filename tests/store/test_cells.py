from typing import Any

import pytest

from app.digests import has_digest
from app.errors import Conflict, NotFound
from app.store import cells, completion, jobs
from app.store.engine import Store
from app.store.records import NewJob
from tests.support.databases import claimed

KITCHEN = {"name": "kitchen", "stations": [{"id": "cup", "position": [0.1, 0.2, 0.3]}]}


def test_stored_cell_comes_back_unchanged(store: Store) -> None:
    assert cells.put_cell(store, "kitchen", KITCHEN)
    assert cells.get_cell(store, "kitchen").definition == KITCHEN


def test_same_cell_again_is_harmless_and_another_one_refused(store: Store) -> None:
    cells.put_cell(store, "kitchen", KITCHEN)
    assert not cells.put_cell(store, "kitchen", dict(KITCHEN))
    with pytest.raises(Conflict, match="'kitchen' with other content is stored: remove it"):
        cells.put_cell(store, "kitchen", {"name": "kitchen", "stations": []})
    assert cells.get_cell(store, "kitchen").definition == KITCHEN


def test_removed_cell_makes_room_for_another(store: Store) -> None:
    cells.put_cell(store, "kitchen", KITCHEN)
    cells.remove_cell(store, "kitchen")
    assert cells.put_cell(store, "kitchen", {"name": "kitchen"})


def test_cells_are_listed_by_name(store: Store) -> None:
    for name in ("b", "a", "c"):
        cells.put_cell(store, name, {"name": name})
    assert [record.name for record in cells.list_cells(store)] == ["a", "b", "c"]


def test_cells_are_listed_with_one_digest_each_and_names_without(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("b", "a"):
        cells.put_cell(store, name, {"name": name})
    compared = list[str]()

    def noted(expected: str | None, content: dict[str, Any]) -> bool:
        compared.append(content["definition"]["name"])
        return has_digest(expected, content)

    monkeypatch.setattr(cells, "has_digest", noted)
    assert cells.list_names(store) == ("a", "b")
    assert compared == []
    cells.list_cells(store)
    assert compared == ["a", "b"]


def test_unknown_cell_is_not_found(store: Store) -> None:
    with pytest.raises(NotFound):
        cells.get_cell(store, "kitchen")
    with pytest.raises(NotFound):
        cells.remove_cell(store, "kitchen")


def test_cell_stays_while_a_job_waits_or_trains_in_it(store: Store) -> None:
    cells.put_cell(store, "kitchen", KITCHEN)
    jobs.create_job(store, NewJob(kind="train", spec={}, overrides={"cell": "kitchen"}))
    with pytest.raises(Conflict, match="in use by job"):
        cells.remove_cell(store, "kitchen")
    found = claimed(store)
    with pytest.raises(Conflict, match="in use by job"):
        cells.remove_cell(store, "kitchen")
    completion.finish(store, found[0])
    cells.remove_cell(store, "kitchen")


def test_only_so_many_cells_are_kept(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cells, "MAX_CELLS", 2)
    for name in ("a", "b"):
        cells.put_cell(store, name, {"name": name})
    with pytest.raises(Conflict, match="the limit"):
        cells.put_cell(store, "c", {"name": "c"})
