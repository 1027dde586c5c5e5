"""Results of the reach protocols with made-up numbers, for the tests of the page."""

import itertools
from typing import Any

import numpy as np

from app.policies.evaluation.reach.people import SPEEDS
from app.policies.evaluation.reach.random_goals import RINGS
from app.policies.evaluation.reach.tracker import ROWS
from app.policies.evaluation.statistics import wilson

Json = dict[str, Any]
MACHINE = {"cpu": "Some CPU", "cores": 2, "commit": "0123456789ab"}
LIMITS = {"speed_limit_rad_s": 1.0, "acceleration_limit_rad_s2": 5.0}


def rates(n: int, failed: float, collided: float = 0.6) -> Json:
    """Ends of ``n`` episodes of which a share fails, by collision for the most part."""
    bad = round(n * failed)
    hit = round(collided * bad)
    return {
        "n": n,
        "success": wilson(n - bad, n),
        "collision": wilson(hit, n),
        "timeout": wilson(bad - hit, n),
    }


def row(name: str, n: int, failed: float, **more: Any) -> Json:
    times = {
        "time_to_goal_s": 1.9,
        "time_to_goal_median_s": 1.7,
        "time_to_goal_p95_s": 3.4,
    }
    return {"name": name, **rates(n, failed), **times, **more}


def result(
    protocol: str, rows: list[Json], stated: list[Json] | None = None, **more: Any
) -> Json:
    stated = stated or [{"inference_mode": "direct", "people": ["walker"]} for _ in rows]
    return {
        "protocol": protocol,
        "checkpoint": "f" * 64,
        "seed": 11,
        "episodes": rows[0]["n"],
        "policy": "reach-td3, 4.10 M steps",
        "settings": {
            "cell": "shared-workspace",
            "action": {"degree": 2},
            "rows": {one["name"]: what for one, what in zip(rows, stated, strict=True)},
        },
        "results": rows,
        "machine": MACHINE,
        **more,
    }


def targets(seed: int = 5) -> Json:
    rng = np.random.default_rng(seed)
    cells = []
    for x, y, z in itertools.product(
        (-0.5, -0.3, -0.1, 0.1, 0.3, 0.5), (0.6, 0.8, 1.0), (0.1, 0.3, 0.5)
    ):
        failed = 0.01 + 0.06 * max(0.0, y - 0.7) * rng.random() * (1.4 - z) ** 2
        goal = {"goal": [x, y, z], "height_m": round(z + 0.7, 6)}
        cells.append({**goal, **rates(100, min(failed + 0.02 * rng.random(), 0.4))})
    worst = sorted(cells, key=lambda cell: cell["success"]["mean"])[:5]
    named = [
        {"goal": one["goal"], "height_m": one["height_m"], **one["success"]} for one in worst
    ]
    times = rng.gamma(9.0, 0.2, 5300)
    ends = np.histogram(times, np.arange(0.0, 5.01, 0.1))[0].tolist()
    hits = np.histogram(rng.gamma(4.0, 0.4, 60), np.arange(0.0, 5.01, 0.1))[0].tolist()
    more: Json = {
        "worst": named,
        "ends": [
            {"until_s": 0.1 * (k + 1), "success": won, "collision": hit}
            for k, (won, hit) in enumerate(zip(ends, hits, strict=True))
        ],
        "targets": cells,
    }
    rows = [
        row("clearance", 5400, 0.019, initial_contact=wilson(0, 5400), **more),
        row("uniform", 5400, 0.071, initial_contact=wilson(285, 5400), **more),
        row("authors", 5400, 0.083, initial_contact=wilson(270, 5400), **more),
    ]
    return result("reach-targets", rows)


def random_goals(shift: float = 0.0, methods: tuple[str, ...] = ("direct",)) -> Json:
    rows = [row("targets", 5000, 0.019)]
    for k, method in enumerate(methods):
        worse = 0.003 + 0.007 * k + shift
        between = [
            {"low_m": low, "high_m": high, **rates(1000, 0.019 + worse * (1.0 + 4.0 * low))}
            for low, high in itertools.pairwise(RINGS)
        ]
        against = {"mean": -worse, "low": -worse - 0.004, "high": -worse + 0.004}
        rows.append(row(method, 5000, 0.019 + worse, against_targets=against, between=between))
        rows.append(row(f"{method}-25s", 5000, 0.012 + worse))
    asked = ["direct", *(method for method in methods for _ in range(2))]
    return result(
        "reach-random",
        rows,
        [{"inference_mode": method, "people": ["walker"]} for method in asked],
    )


def people() -> Json:
    rows, stated = [], []
    for n in range(5):
        for method in ("direct", "distance-weighted") if n > 1 else ("direct",):
            name = f"{n}-people" + (f"-{method}" if n > 1 else "")
            failed = 0.019 * n * (1.0 if method == "direct" else 1.3)
            rows.append(row(name, 1000, failed, starts_redrawn=0.07 * n))
            stated.append({"inference_mode": method, "people": ["walker"] * n})
    return result("reach-people", rows, stated)


def speeds() -> Json:
    rows = [row(f"{speed:g}-m-s", 1000, 0.01 + 0.02 * speed) for speed in SPEEDS]
    stated = [
        {"inference_mode": "direct", "people": ["fixed-speed"], "speed_m_s": speed}
        for speed in SPEEDS
    ]
    return result("reach-speeds", rows, stated)


def tracker() -> Json:
    rows = [row("exact", 5400, 0.019)]
    for k, name in enumerate(ROWS):
        off = {"axis_error_median_mm": 4.0 + 9.0 * k, "axis_error_p95_mm": 30.0 + 20.0 * k}
        rows.append(row(name, 5400, 0.021 + 0.006 * k, **off))
    return result("reach-tracker", rows)


def smoothness(degree: int = 2) -> Json:
    n, dt, limit = 126, 0.02, 5.0
    t = dt * np.arange(n)
    qdd = np.stack([limit * np.sin((2.0 + j) * t + j) * np.exp(-0.4 * t) for j in range(6)], 1)
    qd = np.clip(np.cumsum(qdd, axis=0) * dt, -1.0, 1.0)
    q = np.array([0.0, -2.5, 2.0, 0.0, 0.0, 0.0]) + np.cumsum(qd, axis=0) * dt
    example = {
        "episode": 3,
        "dt_s": dt,
        "q_rad": q.tolist(),
        "qd_rad_s": qd.tolist(),
        "qdd_rad_s2": qdd.tolist(),
        "clearance_m": (0.4 + 0.3 * np.cos(2.0 * t)).tolist(),
        "distance_m": (1.2 - 0.43 * t).tolist(),
    }
    measures = {
        "position_margin_rad": 0.31,
        "speed_rad_s": 1.0,
        "acceleration_rad_s2": 5.0,
        "position_jump_rad": 4.4e-16,
        "speed_jump_rad_s": 4.4e-14,
        "acceleration_jump_rad_s2": 10.0 if degree == 2 else 0.0,
        "mean_jerk_rad_s3": 31.4,
        "rms_acceleration_rad_s2": 1.9,
        **LIMITS,
        **({"jerk_rad_s3": 50.0, "jerk_limit_rad_s3": 50.0} if degree == 3 else {}),
    }
    one = {"name": f"degree-{degree}", "n": 1000, "success": wilson(980, 1000), **measures}
    made = result("reach-smoothness", [one], example=example)
    made["settings"]["action"]["degree"] = degree
    return made


def curves() -> Json:
    found = []
    for name, end, scale in (("reach-td3", 0.98, 2.0), ("reach-ddpg-thesis", 0.4, 120.0)):
        for seed in (1, 2, 3) if name == "reach-td3" else (1,):
            minutes = np.geomspace(0.2, 25.0 if name == "reach-td3" else 360.0, 40)
            success = end * (1.0 - np.exp(-minutes / scale)) * (1.0 - 0.01 * seed)
            points = [
                {
                    "step": int(1e5 * m),
                    "cpu_s": 60.0 * m,
                    "success": s,
                    "collision": 0.3 * (1 - s),
                    "timeout": 0.7 * (1 - s),
                }
                for m, s in zip(minutes.tolist(), success.tolist(), strict=True)
            ]
            found.append({"name": name, "seed": seed, "played": points, "targets": []})
    return {"curves": found, "seed": 77, "machine": MACHINE}


def ceiling() -> Json:
    one = {
        "name": "oracle",
        "n": 5400,
        "solvable": wilson(5330, 5400),
        "never": wilson(8, 5400),
        "undecided": wilson(62, 5400),
        "resimulations": 123456,
        "worst_targets": [{"goal": [0.1, 1.0, 0.1], "solvable": 0.9}],
    }
    return result("reach-oracle", [one])


def ssm() -> Json:
    time = {"mean": 4.1, "low": 4.0, "high": 4.2, "sd": 0.9}
    contacts = {"contacts_moving": 0, "contacts_at_rest": 2}
    policy = {
        "name": "policy",
        "n": 200,
        "arrived": wilson(199, 200),
        "time_s": time,
        **contacts,
    }
    random = {"name": "random", "n": 10000, "success": wilson(9600, 10000), **contacts}
    made = result("reach-ssm", [policy, random])
    made["settings"]["motions"] = []
    return made
