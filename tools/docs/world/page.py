"""Validate the simulator: measure, draw and write ``docs/world.md``.

    python -m tools.docs.world.page          measure, draw and write
    python -m tools.docs.world.page --page   write the text and scaling.png from docs/results

Writes ``docs/results/world.json``, ``docs/img/world/*.png`` and the page, which is the text of
``tools/docs/world.template.md`` with these numbers and with tables from ``docs/results``.
Seeded; takes about half a minute. The benchmarks ``sim-steps`` and ``sim-scaling`` are not run.
"""

import argparse
import sys
from pathlib import Path

from app.provenance import describe
from tools.docs.results import IMAGES, RESULTS, ROOT, Json, read_result, write_result
from tools.docs.tables import render
from tools.docs.world import measures as world_measures
from tools.docs.world import override as world_override
from tools.docs.world import plots as world_plots

SEED = 11
PICTURES = IMAGES / "world"
PAGE, TEMPLATE = ROOT / "docs/world.md", ROOT / "tools/docs/world.template.md"
SHARES = ("qd_share", "qdd_share", "jerk_share")


def values(world: Json, scaling: Json) -> Json:
    """Return the numbers of the page, from the JSON results only."""
    machine, gap, limits, walk = (world[key] for key in ("machine", "gap", "limits", "walker"))
    degrees = [limits["degree_2"], limits["degree_3"]]
    costs = {row["name"]: row.get("us_per_step", 0.0) for row in scaling["results"]}
    alone = costs["pick/workers-0"]
    shares = ", ".join(f"{100.0 * share:.0f}" for share in world["reach"]["table_share"])
    return {
        "seed": world["seed"],
        "cpu": f"{machine['cores']} cores of {machine['cpu']}",
        "commit": machine["commit"],
        "n_capsules": world["references"]["capsules"],
        "gap_n": gap["links"]["n"],
        "gap_all": gap["all"]["n"],
        "gap_near": gap["nearer_than_m"],
        "gap_mean": gap["links"]["mean_mm"],
        "gap_p95": gap["links"]["p95_mm"],
        "gap_max": gap["links"]["max_mm"],
        "gap_min": gap["links"]["min_mm"],
        "gap_mean_all": gap["all"]["mean_mm"],
        "hand_speed": world["fast_hands"]["speed_m_s"],
        "hand_periods": world["fast_hands"]["periods"],
        "hand_touching": world["fast_hands"]["touching"],
        "hand_late": world["fast_hands"]["late"] or "None",
        "hand_between": world["fast_hands"]["clear_at_ends"],
        "hand_early": world["fast_hands"]["only_capsules"],
        "ends": world["references"]["capsule_ends_m"],
        "distances": world["references"]["distances_m"],
        **{
            key: world["references"][key]
            for key in ("configurations", "overlapping", "pairs", "fcl_pairs")
        },
        "limits_cell": limits["cell"],
        "dt_ms": 1e3 * limits["dt_s"],
        "episodes": limits["episodes"],
        "over": max(0.0, *(one["q_over_rad"] for one in degrees)),
        "excess": max(0.0, *(one[name] - 1.0 for one in degrees for name in SHARES)),
        "walk_s": walk["seconds"],
        "walks": walk["walks"],
        "v_min": walk["bounds_m_s"][0],
        "v_max": walk["bounds_m_s"][1],
        "v_low": walk["speed_m_s"][0],
        "v_high": walk["speed_m_s"][1],
        "standing": 100.0 * walk["standing_share"],
        "r_low": walk["radius_m"][0],
        "r_high": walk["radius_m"][1],
        **visit_values(world["visit"]),
        "heights": ", ".join(f"{z:g}" for z in world["reach"]["heights_m"]),
        "table_share": shares,
        "reach_cell": world["reach"]["cell"],
        "worker_us": (costs["pick/workers-4"] - alone) / 4.0,
        "walker_us": (costs["pick/walkers-4"] - alone) / 4.0,
    }


def visit_values(visit: Json) -> Json:
    """Return the numbers of the section on a person who walks in."""
    settings = visit["settings"]
    return {
        "visit_cell": visit["cell"],
        "visit_speed": visit["person_peak_m_s"],
        "v_h": settings["human_speed [m/s]"],
        "reaction": settings["reaction_time [s]"],
        "protective": settings["protective_distance [m]"],
        "below_half": visit["below_half_s"],
        "stopped": visit["stopped_s"],
        "moving": visit["least_separation_moving_m"],
        "resting": visit["least_separation_m"],
    }


def page(results: Path) -> str:
    """Return the page's text.

    Args:
        results: Folder of the JSON files.
    """
    read = (read_result(results / f"{name}.json") for name in ("world", "sim-scaling"))
    text = TEMPLATE.read_text(encoding="utf-8")
    return render(text.format(**values(*read)), results)


def measure_and_draw() -> Json:
    """Write the pictures; return the numbers."""
    machine = describe()  # of the tree that is measured, before a file is written
    gap, postures = world_measures.mesh_gap(SEED)
    world_plots.save(world_plots.mesh_gap, PICTURES / "mesh-gap.png", postures)
    limits, *shown = world_measures.limits(SEED)
    world_plots.save(world_plots.limits, PICTURES / "limits.png", *shown)
    walker, *walks = world_measures.walker(SEED)
    world_plots.save(world_plots.walker, PICTURES / "walker.png", *walks)
    visit, seen = world_override.visit()
    world_plots.save(world_override.draw, PICTURES / "override.png", seen)
    reach, maps = world_measures.reach()
    world_plots.save(world_plots.reach, PICTURES / "reach.png", maps)
    return {
        "page": "world",
        "seed": SEED,
        "references": world_measures.references(),
        "gap": gap,
        "fast_hands": world_measures.fast_hands(SEED),
        "limits": limits,
        "walker": walker,
        "visit": visit,
        "reach": reach,
        "machine": machine,
    }


def draw_scaling() -> None:
    """Draw the results of ``bench sim-scaling``."""
    scaling = read_result(RESULTS / "sim-scaling.json")
    world_plots.save(world_plots.scaling, PICTURES / "scaling.png", scaling["results"])


def main() -> None:
    """Measure, draw, write."""
    parser = argparse.ArgumentParser(description="Write docs/world.md.")
    parser.add_argument(
        "--page",
        action="store_true",
        help="write the page and scaling.png from docs/results, without measuring",
    )
    if not parser.parse_args().page:
        write_result(RESULTS / "world.json", measure_and_draw())
    draw_scaling()
    PAGE.write_text(page(RESULTS), encoding="utf-8")
    n_pictures = len(list(PICTURES.glob("*.png")))
    print(f"{PAGE.relative_to(ROOT)}, {n_pictures} pictures", file=sys.stderr)


if __name__ == "__main__":
    main()
