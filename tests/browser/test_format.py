"""Numbers and texts on the page and its plots have one form each, as in status messages."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, Route

from app.live.status_messages import length_text, percent_text, value_text

pytestmark = pytest.mark.browser

FILES = Path(__file__).parents[2] / "web" / "page"
ORIGIN = "http://page.test"
CALL = "([name, of]) => import('/format.js').then((one) => of.map((v) => one[name](v)))"
LENGTHS = [0.0, 1e-5, 4.9e-4, 5.1e-4, 0.004, 0.00949, 0.0096, 0.0149, 0.3, 0.994, 1.236]
PLOTTED = """([steps, values]) => {
  window.written = [];
  const {prototype} = CanvasRenderingContext2D, write = prototype.fillText;
  prototype.fillText = function (text, x, y) {
    const left = this.textAlign === "right" ? x - this.measureText(text).width : x;
    if (this.textAlign === "right") window.written.push([text, left]);
    return write.call(this, text, x, y);
  };
  document.body.innerHTML = "<div style='width: 400px'></div>";
  return Promise.all(["/vendor/htm-preact-standalone.module.js", "/plots.js"]
    .map((path) => import(path))).then(([{html, render}, {CurvePlot}]) =>
      render(html`<${CurvePlot} height=${160} label="plot"
        rows=${steps.map((step, i) => ({step, value: values[i]}))}
        lines=${[{key: "value", label: "value", colour: "accent"}]} />`,
        document.body.firstChild));
}"""
COMPARISON: dict[str, Any] = {
    "jobs": [{"id": "a", "number": 1, "seed": 1, "preset": "p" * 90, "name": None}],
    "quantity": "success",
    "quantities": ["success"],
    "steps": [100, 200],
    "groups": [
        {"jobs": ["a"], "mean": [0.1, 0.9], "low": [0.1, 0.9], "high": [0.1, 0.9], "n": [1, 1]}
    ],
    "differences": [],
}
COMPARED = """() => {
  window.written = [];
  const {prototype} = CanvasRenderingContext2D, write = prototype.fillText;
  prototype.fillText = function (text, x, y) {
    const end = x + this.measureText(text).width;
    if (!this.canvas.isConnected) window.written.push([text, end, this.canvas.width]);
    return write.call(this, text, x, y);
  };
  return Promise.all(["/vendor/htm-preact-standalone.module.js", "/training/compare.js"]
    .map((path) => import(path))).then(([{html, render}, {Comparison}]) => render(
      html`<${Comparison} ids=${["a"]} presets=${{items: []}} />`, document.body));
}"""
CLONED = """(job) => Promise.all(["/vendor/htm-preact-standalone.module.js",
    "/training/trainform.js"].map((path) => import(path)))
  .then(([{html, render}, {TrainForm}]) => render(html`<${TrainForm} from=${job}
    presets=${{items: [{name: job.preset, title: "Preset", fields: []}], error: null}}
    onStarted=${() => {}} onClose=${() => {}} />`, document.body))"""
RANGES = """(all) => Promise.all(["/vendor/htm-preact-standalone.module.js",
    "/live/status.js"].map((path) => import(path)))
  .then(([{html, render}, {TrainingRange}]) => all.map((outside) => {
    const world = {elapsed_ms: 1, outside: [], people: [], candidates: [{outside}]};
    render(html`<${TrainingRange} world=${world} />`, document.body);
    return document.body.textContent;
  }))"""
STATES = """(world) => Promise.all(["/vendor/htm-preact-standalone.module.js",
    "/live/status.js"].map((path) => import(path)))
  .then(([{html, render}, {StatusPanel}]) => {
    render(html`<${StatusPanel} world=${world} />`, document.body);
    return [...document.querySelectorAll(".story .chip")].map((one) => one.textContent);
  })"""
VALUES = [-5.126, -0.52, -0.004, 0.0, 0.004, 3.3201]


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """A blank document beside the page's modules."""

    def answer(route: Route) -> None:
        name = route.request.url.removeprefix(ORIGIN).strip("/")
        if name:
            route.fulfill(path=FILES / name, content_type="text/javascript")
        else:
            route.fulfill(body="", content_type="text/html")

    page = browser.new_page()
    page.route(f"{ORIGIN}/**", answer)
    page.goto(ORIGIN)
    yield page
    page.close()


def written(page: Page, name: str, values: list[Any]) -> list[str]:
    """Return what a function of format.js makes of values, with plain spaces."""
    texts: list[str] = page.evaluate(CALL, [name, values])
    return [text.replace("\u00a0", " ") for text in texts]


def test_lengths_and_values_are_those_of_status_messages(page: Page) -> None:
    assert written(page, "length", LENGTHS) == [length_text(one) for one in LENGTHS]
    assert written(page, "value", VALUES) == [value_text(one) for one in VALUES]
    shares = [0.0, 0.231, 1.0]
    assert page.evaluate(
        "of => import('/format.js').then((one) => of.map((v) => one.percent(v, 0)))", shares
    ) == [percent_text(one).replace(" ", "\u00a0") for one in shares]


def test_distance_to_a_person_is_given_in_mm_below_1_cm(page: Page) -> None:
    gaps = [None, -0.01, 0.0, 2e-4, 0.004, 0.0123]
    expected = ["–", "contact", "contact", "< 1 mm", "4 mm", "0.01 m"]
    assert written(page, "gap", gaps) == expected


def test_a_rounded_million_is_written_as_one(page: Page) -> None:
    counts = [9_999, 999_949, 999_950, 1_250_000]
    assert written(page, "steps", counts) == ["9999", "999.9 k", "1 M", "1.25 M"]


def test_counts_agree_with_their_noun(page: Page) -> None:
    code = "of => import('/format.js').then((one) => of.map((v) => one.count(v, 'step')))"
    texts = page.evaluate(code, [0, 1, 2, 12_400])
    assert texts == ["0 steps", "1 step", "2 steps", "12.4\u00a0k steps"]


@pytest.mark.parametrize("values", [[-500.0], [481_600.0, 481_900.0], [0.0, 2.6e6], [0.2, 2]])
def test_ticks_of_a_plot_have_labels_that_differ_and_fit(
    page: Page, values: list[float]
) -> None:
    page.add_script_tag(url=f"{ORIGIN}/vendor/uPlot.iife.min.js")
    page.evaluate(PLOTTED, [list(range(1, len(values) + 1)), values])
    page.wait_for_function("window.written.length > 2")
    labels = page.evaluate("window.written")
    texts = [text for text, _ in labels]
    assert len(set(texts)) == len(texts)
    assert min(left for _, left in labels) >= 0.0


def test_picture_of_a_comparison_is_as_wide_as_its_legend(page: Page) -> None:
    page.set_viewport_size({"width": 360, "height": 780})
    page.add_script_tag(url=f"{ORIGIN}/vendor/uPlot.iife.min.js")
    page.route(f"{ORIGIN}/v1/comparison**", lambda route: route.fulfill(json=COMPARISON))
    page.evaluate(COMPARED)
    with page.expect_download():
        page.locator('[data-action="png"]').click()
    written = page.evaluate("window.written")
    assert any("last 90.0" in text for text, *_ in written)
    assert all(end <= width for _, end, width in written)


def test_integers_that_a_number_would_round_are_no_numbers_of_a_form(page: Page) -> None:
    texts = ["9007199254740991", "9007199254740993", "-9_007_199_254_740_993", "1e3", "0.5"]
    call = "of => import('/training/formfields.js').then((one) => of.map(one.parsed))"
    expected = [9007199254740991, "9007199254740993", "-9007199254740993", 1000, 0.5]
    assert page.evaluate(call, texts) == expected


@pytest.mark.parametrize(("typed", "sent"), [(None, {}), ("7", {"seed": 7})])
def test_clone_has_the_seed_of_its_job_unless_another_is_typed(
    page: Page, typed: str | None, sent: dict[str, int]
) -> None:
    page.route(f"{ORIGIN}/v1/jobs/**", lambda route: route.fulfill(json={}))
    job = {"id": "a", "number": 1, "preset": "p", "seed": 2**53, "overrides": {}}
    page.evaluate(CLONED, job)
    if typed is not None:
        page.fill("#train-seed", typed)
    with page.expect_request(f"{ORIGIN}/v1/jobs/a/clone") as request:
        page.click("form.train [type=submit]")
    body = request.value.post_data_json
    assert {name: body[name] for name in body if name == "seed"} == sent


def test_times_are_given_in_days_from_two_days_on(page: Page) -> None:
    texts: list[str] = page.evaluate(
        """of => import("/format.js").then((one) => of.map((s) =>
          one.ago("2026-03-01T12:00:00Z", Date.parse("2026-03-01T12:00:00Z") + 1000 * s)))""",
        [4, 90, 5400, 2 * 86400, 30.5 * 86400],
    )
    shown = [text.replace("\u00a0", " ") for text in texts]
    assert shown == ["just now", "1 min ago", "1 h 30 min ago", "2 days ago", "30 days ago"]


def test_numbers_have_true_minus_signs_and_grouped_digits(page: Page) -> None:
    numbers = [12_288_000, -20_000, -0.5, 1e-7, "pick", [1, 2]]
    expected = [
        "12\u202f288\u202f000",
        "\u221220\u202f000",
        "\u22120.5",
        "1e-7",
        "pick",
        "[1,2]",
    ]
    assert written(page, "grouped", numbers) == expected


@pytest.mark.parametrize(
    ("message", "sentence"),
    [
        ("no preset 'td-4'", "No preset 'td-4'."),
        ("seed = -1 must be at least 0", "seed = \u22121 must be at least 0."),
        (
            "learning.lr_start = '-1' must lie in [-3, 1e-2]",
            "learning.lr_start = '-1' must lie in [\u22123, 1e-2].",
        ),
        ("c_c grows to it linearly", "c_c grows to it linearly."),
        ("The server is away …", "The server is away …"),
    ],
)
def test_message_of_the_service_is_shown_as_a_sentence(
    page: Page, message: str, sentence: str
) -> None:
    assert written(page, "sentence", [message]) == [sentence]


@pytest.mark.parametrize(
    ("field", "value", "shown"),
    [
        ("people[0].q.elbow_r", 2.7, "Person 1: right elbow 155°, training range 0° to 57°"),
        ("people[1].q.elbow_r", 2.7, "Person 4: right elbow 155°, training range 0° to 57°"),
        ("people[1].q.pelvis_x", 2.7, "Person 4: pelvis x 2.7 m, training range 0 m to 1 m"),
        ("people[0].q.pelvis_yaw", 2.7, "Person 1: pelvis yaw 155°, training range 0° to 57°"),
        (
            "people[0].qd.pelvis_yaw",
            2.7,
            "Person 1: speed of pelvis yaw 155°/s, training range 0°/s to 57°/s",
        ),
        ("time_left_s", 2.7, "time left 2.7 s, training range 0 s to 1 s"),
        ("goal.z", 2.7, "goal z 2.7 m, training range 0 m to 1 m"),
        ("people[1].x", 2.7, "Person 4: position x 2.7 m, training range 0 m to 1 m"),
        ("people[0].vy", 2.7, "Person 1: speed along y 2.7 m/s, training range 0 m/s to 1 m/s"),
        ("people", 2.7, "number of people 2.7, training range 0 to 1"),
    ],
)
def test_input_outside_the_training_range_has_the_name_of_its_person_and_its_unit(
    page: Page, field: str, value: float, shown: str
) -> None:
    people = [{"id": 0}, {"id": 3}]
    text = page.evaluate(
        """([one, people]) =>
          import("/live/status.js").then((of) => of.outsideText(one, people))""",
        [{"field": field, "value": value, "low": 0.0, "high": 1.0}, people],
    )
    assert " ".join(text).replace("\u00a0", " ") == shown


def test_inputs_are_in_distribution_only_if_those_of_all_candidates_are(page: Page) -> None:
    far = {"field": "position.x", "value": 3.0, "low": 0.0, "high": 1.0}
    texts = page.evaluate(RANGES, [[], [far]])
    assert ["In distribution" in text for text in texts] == [True, False]


@pytest.mark.parametrize(
    ("status", "paused", "shown"),
    [
        ("contact", True, ["Paused", "Contact"]),
        ("contact", False, ["Contact"]),
        ("moving", True, ["Paused", "Stopped"]),
    ],
)
def test_pause_hides_no_state_of_the_robot(
    page: Page, status: str, paused: bool, shown: list[str]
) -> None:
    world = {
        "status": status,
        "paused": paused,
        "t_s": 1.0,
        "clearance_m": 0.3,
        "safety": {"on": True, "override": 0.0, "person": None},
    }
    assert page.evaluate(STATES, world) == shown


@pytest.mark.parametrize(
    ("person", "separation", "advised", "short"),
    [
        (0, 0.36, 1.0, False),
        (0, 0.36, 0.4, True),
        (0, 0.38, 0.4, False),
        (None, None, 1.0, False),
    ],
)
def test_distance_is_too_short_where_the_layer_slows_the_robot(
    page: Page, person: int | None, separation: float | None, advised: float, short: bool
) -> None:
    safety = {"person": person, "separation": separation, "required": 0.37, "advised": advised}
    call = "(of) => import('/live/safety.js').then((one) => one.isTooNear(of))"
    assert page.evaluate(call, safety) is short
