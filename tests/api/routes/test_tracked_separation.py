"""The override beside tracked people: never more than their last arrived frame allows.

Any sequence of frames, gaps, missing limbs, wild stamps, clock changes and decisions, on the
test's own clock; the reference is the safety layer itself, given the true person at the
arrival of the last frame that showed them, and the time since.
"""

from dataclasses import dataclass, field, replace
from functools import cache, lru_cache

import numpy as np
import pytest

from app.api.motion.decision import decide
from app.api.schemas.motion import MotionAnswer, MotionRequest
from app.api.tracker_sessions import TrackerSession, TrackerSessions
from app.errors import ClockJump
from app.policies.checkpoints import pretrained
from app.policies.inference.motion_decision import MotionDecider
from app.policies.inference.reach_policy import ReachPolicy
from app.sim.cells.cell import load_cell
from app.sim.collision.checker import shapes_of
from app.sim.human import model as human
from app.sim.perception.keypoints import BODY_25, keypoints_of
from app.sim.perception.observed_people import as_monitored
from app.sim.perception.single_frame import estimate_once
from app.sim.reach.query_state import QueryState
from app.sim.robot.measured_state import Joints
from app.sim.safety.layer import SafetyLayer, safety_settings
from app.sim.scene.scene import arm_of

CELL = load_cell("shared-workspace")
ARM = arm_of(CELL)
DT = 1.0 / 30.0
ESTIMATION_ERROR = 0.06
"""How far filtered key-points of a person who walks may lag behind exact ones [m]."""
SEEDS = range(24)
RIGHT_ARM = [BODY_25.index(name) for name in ("elbow_r", "wrist_r")]


@lru_cache(maxsize=1)
def policy() -> MotionDecider:
    return MotionDecider(ReachPolicy(pretrained.load("reach")), CELL)


def points_of(q: np.ndarray) -> np.ndarray:
    return keypoints_of(q, CELL.body, CELL.floor_z)


@dataclass
class Scene:
    """A person who walks about, a tracker that watches, and the robot."""

    rng: np.random.Generator
    now: float = 100.0
    skew: float = 500.0
    shown: tuple[np.ndarray, float] | None = None
    session: TrackerSession = field(init=False)

    def __post_init__(self) -> None:
        self.trackers = TrackerSessions(lambda: self.now)
        self.session = self.trackers.open(CELL.name, 1, CELL.body, CELL.floor_z)
        self.place = np.array([self.rng.uniform(-0.6, 0.6), self.rng.uniform(1.2, 2.4)])
        self.velocity = np.zeros(2)
        self.flex, self.flexing, self.hidden = 0.15, 0.0, False
        self.answers = self.limited = 0

    def posture(self) -> np.ndarray:
        q = human.rest_posture(self.place[0], self.place[1], -np.pi / 2.0)
        q[human.JOINT_NAMES.index("shoulder_r_flex")] = self.flex
        return q

    def wait(self, seconds: float) -> None:
        """Let time pass; the person walks at up to 0.9 m/s, an arm swings at up to 0.6 m/s."""
        self.now += seconds
        if self.rng.uniform() < 0.1:
            speed, heading = self.rng.uniform(0.0, 0.9), self.rng.uniform(-np.pi, np.pi)
            self.velocity = speed * np.array([np.cos(heading), np.sin(heading)])
            self.flexing = self.rng.uniform(-1.0, 1.0)
        self.flex = float(np.clip(self.flex + seconds * self.flexing, 0.0, 1.4))
        self.place = np.clip(self.place + seconds * self.velocity, [-1.0, 0.9], [1.0, 3.0])

    def frame(self, stamp: float, event: str = "frame") -> None:
        """Send a frame of this moment, and note the person that it showed if it is taken."""
        points = points_of(self.posture())
        if self.hidden:
            points[RIGHT_ARM] = np.nan
        if event == "foreign":  # in millimetres, or a camera's axes
            turned = points @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]).T + [0.0, 0.0, 2.0]
            points = 1000.0 * points if self.rng.uniform() < 0.5 else turned
        people = [] if event == "empty" else [points]
        trust = np.full(25, {"percent": 90.0, "weak": 0.05}.get(event, 1.0))
        try:
            self.session.take(stamp, self.now, people, [trust] * len(people))
        except ClockJump:
            return
        if people and event not in ("foreign", "percent", "weak"):
            self.shown = self.posture(), self.now

    def watch(self, n_frames: int) -> None:
        """Send frames at 30 Hz of a person who stands still."""
        for _ in range(n_frames):
            self.now += DT
            self.frame(self.now)

    def decision(self, t: float | None) -> None:
        body = {
            "cell": CELL.name,
            "robot": {
                "q": (np.array(CELL.robot.home_q) + self.rng.uniform(-0.3, 0.3, 6)).tolist(),
                "qd": self.rng.uniform(-0.6, 0.6, 6).tolist(),
            },
            "goal": [0.05, 0.75, 0.31],
            "people": [{"tracker": self.session.id, "person": 0, "t": t}],
            "rollout": False,
        }
        request = MotionRequest.model_validate(body)
        answer = MotionAnswer(**decide(request, CELL, policy(), self.trackers))
        assert answer.safety is not None
        allowed = self.allowed(request, answer)
        assert answer.safety.override <= allowed + 1e-9
        self.answers += answer.safety.override > 0.0
        self.limited += allowed < 1.0

    def allowed(self, request: MotionRequest, answer: MotionAnswer) -> float:
        """The override that the person at the last frame's arrival allows."""
        if self.shown is None:  # before the first frame anybody may be anywhere
            return 1.0 if self.session.n_frames else 0.0
        q_human, arrived = self.shown
        settings = safety_settings(CELL)
        nearer = settings.protective_distance - ESTIMATION_ERROR
        layer = SafetyLayer(
            ARM,
            type(settings)(
                reaction_time=settings.reaction_time,
                tracker_delay=settings.tracker_delay,
                human_speed=settings.human_speed,
                protective_distance=nearer,
            ),
        )
        c = np.array([joint[2] for joint in answer.commanded.coefficients])
        people = shapes_of(CELL, q_human[None])
        return layer.decide(
            np.array(request.robot.q),
            np.array(request.robot.qd),
            c,
            np.zeros(6),
            people,
            self.now - arrived,
        ).override


@cache
def after_events(seed: int) -> Scene:
    """A scene after 200 random events, decisions among them."""
    scene = Scene(np.random.default_rng(seed))
    rng = scene.rng
    for _ in range(200):
        event = rng.choice(
            ["frame", "gap", "wild", "clock", "limb", "empty", "foreign", "late"]
            + ["decide", "decide-t"],
            p=[0.48, 0.03, 0.02, 0.02, 0.03, 0.02, 0.02, 0.02, 0.26, 0.1],
        )
        scene.wait(DT * rng.uniform(0.8, 1.2) if event != "gap" else rng.uniform(0.05, 4.0))
        stamp = scene.now + scene.skew
        match event:
            case "frame" | "empty" | "foreign":
                scene.frame(stamp, event)
            case "limb":
                scene.hidden = not scene.hidden
            case "wild":
                scene.frame(stamp + float(rng.choice([86400.0, -5.0, -1e6, 1e9])))
            case "late":
                scene.frame(stamp - 0.1)
            case "clock":
                scene.skew += float(rng.choice([-2.0, -600.0, 3600.0, 1.0]))
            case "decide":
                scene.decision(None)
            case "decide-t":
                scene.decision(stamp + float(rng.choice([-1e6, -0.5, 0.0, 0.3, 1e6])))
    return scene


@pytest.mark.parametrize("seed", SEEDS)
def test_override_never_exceeds_what_the_last_arrived_frame_allows(seed: int) -> None:
    after_events(seed)


def test_scenes_of_random_events_have_moving_robots_and_people_who_stop_them() -> None:
    scenes = [after_events(seed) for seed in SEEDS]
    assert sum(scene.answers for scene in scenes) > 400
    assert sum(scene.limited for scene in scenes) > 400


def at_home(scene: Scene) -> MotionRequest:
    """The request of a robot that stands at home."""
    body = {
        "cell": CELL.name,
        "robot": {"q": list(CELL.robot.home_q), "qd": [0.0] * 6},
        "goal": [0.05, 0.75, 0.31],
        "people": [{"tracker": scene.session.id, "person": 0}],
    }
    return MotionRequest.model_validate(body)


def decide_beside(scene: Scene) -> MotionAnswer:
    """The answer to a robot that stands at home."""
    found = decide(at_home(scene), CELL, policy(), scene.trackers)
    return MotionAnswer.model_validate(found)


def test_the_property_is_tried_where_the_robot_may_move() -> None:
    scene = Scene(np.random.default_rng(1))
    scene.place = np.array([0.0, 2.6])
    for _ in range(30):
        scene.now += DT
        scene.frame(scene.now)
        scene.decision(None)
    assert scene.answers > 20


@pytest.mark.parametrize("silence", [0.6, 3.0, 70.0, 250.0])
def test_a_camera_that_died_stops_the_robot(silence: float) -> None:
    scene = Scene(np.random.default_rng(2))
    scene.place = np.array([0.0, 2.0])
    scene.watch(30)
    watched = decide_beside(scene)
    assert watched.safety is not None and watched.safety.override > 0.0
    scene.now += silence
    answer = decide_beside(scene)
    (person,) = answer.people
    assert person.age_s == pytest.approx(silence) and "stale" in person.flags
    assert answer.safety is not None
    assert answer.safety.override == scene.allowed(at_home(scene), answer) == 0.0


@pytest.mark.parametrize("event", ["foreign", "percent", "weak"])
@pytest.mark.parametrize("seen_before", [False, True])
def test_a_tracker_of_another_frame_or_confidence_stops_the_robot(
    seen_before: bool, event: str
) -> None:
    scene = Scene(np.random.default_rng(5))
    scene.place = np.array([0.0, 2.6])
    for k in range(60):
        scene.now += DT
        scene.frame(scene.now, "frame" if seen_before and k < 30 else event)
    (person,) = (answer := decide_beside(scene)).people
    assert {"foreign-frame", "stale"} <= set(person.flags) and person.implausible
    assert answer.safety is not None and answer.safety.override == 0.0
    assert person.age_s == (pytest.approx(1.0) if seen_before else None)


def test_distant_person_does_not_replace_a_hidden_one() -> None:
    scene = Scene(np.random.default_rng(6))
    scene.place = np.array([0.0, 1.6])
    scene.watch(30)
    hidden, stranger = scene.shown, human.rest_posture(0.5, 5.5, -np.pi / 2.0)
    for k in range(60):  # the stranger is 3.9 m from where the other one was last seen
        scene.now += DT
        scene.session.take(scene.now, scene.now, [points_of(stranger)], [np.ones(25)])
        scene.shown = hidden
        if k % 4 == 0:
            scene.decision(None)
    assert decide_beside(scene).people[0].age_s == pytest.approx(2.0)


def test_an_arm_that_is_not_seen_is_monitored_wherever_it_can_reach() -> None:
    scene = Scene(np.random.default_rng(3))
    scene.place, scene.flex = np.array([0.0, 2.05]), 1.4
    for k in range(60):
        scene.now += DT
        scene.hidden = k > 30
        scene.frame(scene.now)
        if k % 10 == 9:
            scene.decision(None)
    person = decide_beside(scene).people[0]
    assert person.monitored_as_cylinder and not person.as_cylinder
    scene.hidden = False
    scene.now += DT
    scene.frame(scene.now)
    assert not decide_beside(scene).people[0].monitored_as_cylinder


def test_silent_tracker_without_observed_people_stops_the_robot() -> None:
    scene = Scene(np.random.default_rng(4))
    assert scene.session.n_frames == 0
    before = decide_beside(scene)
    scene.frame(scene.now, "empty")
    fresh = decide_beside(scene)
    scene.now += 1.0
    silent = decide_beside(scene)
    overrides = [one.safety.override for one in (before, fresh, silent) if one.safety]
    assert overrides == [0.0, 1.0, 0.0]
    assert [one.people[0].flags for one in (before, fresh, silent)] == [
        ["never-seen", "stale"],
        ["never-seen"],
        ["never-seen", "stale"],
    ]
    assert fresh.people[0].separation is None and fresh.people[0].age_s is None


def test_a_raised_arm_is_monitored_to_its_full_height() -> None:
    points = points_of(human.rest_posture(0.0, 1.2, -np.pi / 2.0))
    for name, height in (("elbow_r", 1.3), ("wrist_r", 1.6)):
        points[BODY_25.index(name)] = [-0.18, 1.2, height]
    points[[BODY_25.index(name) for name in ("elbow_l", "wrist_l")]] = np.nan
    person = as_monitored(estimate_once(points, CELL.body, floor_z=CELL.floor_z))
    assert person is not None and person.cylinder is not None
    assert person.top > 1.6
    query = QueryState(CELL, 0, 1, policy().actor.view)
    query.load(Joints(np.array(CELL.robot.home_q), np.zeros(6), np.zeros(6)), [person], 5.0)
    assert query.shapes.cylinders[0, 3] == person.top > query.top_z
    query.load(
        Joints(np.array(CELL.robot.home_q), np.zeros(6), np.zeros(6)),
        [replace(person, top=-np.inf)],
        5.0,
    )
    assert query.shapes.cylinders[0, 3] == query.top_z
