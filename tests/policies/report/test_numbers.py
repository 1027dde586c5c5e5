"""Numbers of results, and last points of learning curves."""

from typing import Any

from app.policies.report.numbers import curve_end, stored_value


def test_the_mean_of_one_episode_has_no_interval() -> None:
    several = {"mean": 4.0, "low": 3.0, "high": 5.0}
    rows = [{"name": "a", "time_s": {"mean": 4.0}}, {"name": "b", "time_s": several}]
    assert stored_value({"results": rows}, "a", "time_s", "s") == "4 s"
    assert stored_value({"results": rows}, "b", "time_s", "s") == "4.00 (3.00 to 5.00) s"


def curve(*points: tuple[int, float, float]) -> dict[str, Any]:
    """A curve of points of step, success and processor time."""
    made = [
        {"step": step, "success": share, "reward": share, "cpu_s": cpu}
        for step, share, cpu in points
    ]
    return {"name": "recipe", "played": made}


def test_a_policy_that_no_longer_changes_counts_for_rates_and_not_for_processor_time() -> None:
    curves = [
        curve((100, 0.1, 10.0), (1000, 0.8, 100.0)),
        curve((100, 0.2, 20.0), (1000, 0.4, 300.0)),
        curve((100, 0.0, 10.0), (200, 0.0, 20.0)),
    ]
    found = {"curves": curves}
    assert curve_end(found, "recipe", "success") == "40.0 % after 0.00 M steps, 3 seeds"
    assert curve_end(found, "recipe", "cpu_s", "s") == "200.00 after 0.00 M steps, 2 seeds"
