import pytest

from app.errors import Conflict, InvalidInput, NotFound
from app.policies.configs.presets import resolve
from app.sim.cells.cell import cell_names, load_cell
from app.store.cells import put_cell
from app.store.engine import Store
from jobs.cell_catalog import CellCatalog
from tests.support import workshop


@pytest.fixture
def catalog(store: Store) -> CellCatalog:
    return CellCatalog(store)


def test_cell_of_the_user_s_own_is_found_beside_the_shipped_ones(catalog: CellCatalog) -> None:
    own = workshop.cell()
    assert catalog.add(own)
    assert catalog.get("workshop") == own
    assert catalog.get("pick-and-place") == load_cell("pick-and-place")
    assert catalog.names() == (*cell_names(), "workshop")
    assert [cell.name for cell in catalog.all()] == [*cell_names(), "workshop"]


def test_same_cell_again_is_not_new(catalog: CellCatalog) -> None:
    catalog.add(workshop.cell())
    assert not catalog.add(workshop.cell())
    with pytest.raises(Conflict, match="remove it first"):
        catalog.add(workshop.cell(title="Another one"))


def test_names_of_shipped_cells_are_reserved(catalog: CellCatalog) -> None:
    with pytest.raises(Conflict, match="reserved"):
        catalog.add(workshop.cell(name="pick-and-place"))
    with pytest.raises(Conflict, match="reserved"):
        catalog.remove("pick-and-place")


def test_unknown_cell_names_the_known_ones(catalog: CellCatalog) -> None:
    catalog.add(workshop.cell())
    with pytest.raises(NotFound, match=r"no cell 'kitchen'; known: .*workshop"):
        catalog.get("kitchen")


def test_cell_to_train_in_must_have_what_the_scenario_needs(catalog: CellCatalog) -> None:
    catalog.add(workshop.cell())
    for preset, fits, other in (
        ("pick-td3", "workshop", "sorting-e0"),
        ("sorting-e0-dqn", "sorting-e1", "pick-and-place"),
    ):
        assert catalog.to_train_in(resolve(preset, {"cell": fits})).name == fits
        with pytest.raises(InvalidInput, match=rf"overrides\.cell = '{other}' cannot be"):
            catalog.to_train_in(resolve(preset, {"cell": other}))
        with pytest.raises(InvalidInput, match=r"overrides\.cell = 'kitchen' is not a known"):
            catalog.to_train_in(resolve(preset, {"cell": "kitchen"}))


def test_stored_cell_that_no_longer_fits_hides_no_other(
    catalog: CellCatalog, store: Store
) -> None:
    put_cell(store, "old", {"name": "old", "wheels": 4})
    assert [cell.name for cell in catalog.all()] == list(cell_names())
    with pytest.raises(InvalidInput, match="another version of Tandem"):
        catalog.get("old")


def test_reach_presets_train_where_there_are_goals_to_reach(catalog: CellCatalog) -> None:
    preset = resolve("reach-td3", {})
    assert catalog.to_train_in(preset).name == "shared-workspace"
    with pytest.raises(InvalidInput, match="it needs a goal_region"):
        catalog.to_train_in(resolve("reach-td3", {"cell": "pick-and-place"}))
    with pytest.raises(InvalidInput, match="it needs"):
        catalog.to_train_in(resolve("pick-td3", {"cell": "shared-workspace"}))
