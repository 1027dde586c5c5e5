"""The recording of test 4."""

from PIL import Image

from tools.docs.sorting.recording import IMAGE, captions, recorded


def test_recording_shows_one_solved_episode_with_a_failed_pick_and_an_added_block() -> None:
    states, shape, cell = recorded()
    said = captions(states)
    assert (shape.n_slots, cell.name) == (10, "sorting-e0")
    assert len(said) == len(states)
    assert said.count("The pick failed") == 1
    assert sum("a person adds a large block" in one for one in said) == 1
    assert said[-1] == "Goal reached" and states[-1].solved
    assert [one.n_objects for one in (states[0], states[-1])] == [5, 6]
    with Image.open(IMAGE) as image:
        assert getattr(image, "n_frames", 1) == len(states)
    assert IMAGE.stat().st_size < 1_000_000
