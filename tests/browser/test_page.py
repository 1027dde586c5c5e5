"""The page as a whole: it loads clean, fits, obeys the keyboard and drives the world."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Page, Route, expect

from tests.support import patient_http

pytestmark = pytest.mark.browser

PHONE = (390, 844)


def world(server: str) -> dict:
    found: dict = patient_http.get(f"{server}/v1/worlds/main").json()
    return found


def test_a_visit_leaves_no_errors_in_the_console(open_page: Callable[..., Page]) -> None:
    page = open_page()
    page.frame_locator('[data-role="viewer"]').locator("canvas").first.wait_for()
    page.wait_for_selector('[data-chosen="true"]')
    page.click("#tab-training")
    page.wait_for_selector("#jobs-title")
    assert page.problems == []  # type: ignore[attr-defined]


def test_page_shows_what_the_world_says(open_page: Callable[..., Page], server: str) -> None:
    page = open_page(scene=False)
    page.click('[data-action="pause"]')
    expect(page.locator(".story .chip").first).to_have_text("Paused")
    now = world(server)
    shown = page.locator("[data-candidate]").evaluate_all(
        "rows => rows.map(r => r.dataset.candidate)"
    )
    assert sorted(shown) == sorted(c["id"] for c in now["candidates"])
    page.click('[data-action="pause"]')
    expect(page.locator(".story .chip").first).not_to_have_text("Paused")


def test_value_plot_draws_while_its_data_is_older_than_the_history(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    names = page.evaluate(
        """async () => {
          const { drawValues } = await import("/static/live/value-plot.js");
          const { History } = await import("/static/live/history.js");
          const { themeColours } = await import("/static/palette.js");
          const at = (t_s, chosen) => ({
            t_s, decided_s: t_s, chosen, candidates: [{ id: chosen, value: 1 }],
          });
          const history = new History();
          for (const t of [0, 0.05, 0.1]) history.add(at(t, "first"));
          const named = [];
          const labelOf = (id) => named.push(id) && id;
          const live = { history, colourOf: () => "#000", labelOf };
          const box = document.body.appendChild(document.createElement("div"));
          const series = [{}, { label: "first", paths: () => null }];
          const scales = { x: { time: false } };
          const plot = new uPlot({ width: 300, height: 100, series, scales },
            history.columns(["first"]), box);
          await new Promise(requestAnimationFrame);
          history.samples.pop();
          history.add(at(0.15, "second"));
          drawValues(plot, live, themeColours());
          return named;
        }"""
    )
    assert names == ["first"]


def test_values_of_another_cell_are_forgotten(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    kept = page.evaluate("""async () => {
      const { History } = await import("./static/live/history.js");
      const history = new History();
      for (const [cell, t] of [["one", 1], ["one", 1.05], ["two", 1.1]]) {
        const candidates = [{ id: cell, value: 1 }];
        history.add({ cell, t_s: t, decided_s: t, chosen: cell, candidates }, t);
      }
      return history.ids([]);
    }""")
    assert kept == ["two"]


def test_safety_layer_of_a_paused_cell_is_drawn_again_when_it_changes(
    open_page: Callable[..., Page],
) -> None:
    page = open_page(scene=False)
    drawn = page.evaluate("""async () => {
      const { SafetyHistory } = await import("./static/live/safetyhistory.js");
      const history = new SafetyHistory();
      const versions = [[1, 1], [2, 0.5], [2, 0.5], [2, 0.25]].map(([tick, separation]) => {
        history.add({ tick, t_s: tick / 20, safety: { separation } });
        return history.version;
      });
      return [versions, history.columns([(one) => one.separation])[1]];
    }""")
    assert drawn == [[1, 2, 2, 3], [1, 0.25]]


def test_long_names_of_goals_are_cut_beside_their_values_and_given_in_full(
    open_page: Callable[..., Page],
) -> None:
    name = "Front conveyor, magazine 3, left of the gearbox housing"

    def rename(route: Route) -> None:
        answer = route.fetch()
        cells = answer.json()
        for station in (one for cell in cells["items"] for one in cell["stations"]):
            station["label"] = name
        route.fulfill(json=cells)

    page = open_page((400, 800), scene=False)
    page.route("**/v1/cells", rename)
    page.reload()
    named = {".line-names span": ".plot", ".bar-name span": ".bar-name"}
    for one, place in named.items():
        label = page.locator(f"section[aria-labelledby=values-title] {one}").first
        expect(label).to_have_attribute("title", name)
        # Both at once: between two calls the page may draw other candidates.
        ends = page.wait_for_function(
            """parts => {
              const card = document.querySelector("section[aria-labelledby=values-title]");
              const found = parts.map((part) => card.querySelector(part));
              return found.every(Boolean) && found.map((e) => e.getBoundingClientRect().right);
            }""",
            arg=[one, place],
        ).json_value()
        assert 0.0 < ends[0] <= ends[1] + 0.5, one


def test_a_value_of_a_contact_does_not_flatten_the_plot(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    ranges = page.evaluate(
        """async () => {
          const { valueRange } = await import("/static/live/value-plot.js");
          return [[0.5, 2], [-10, 2], [-10, -7]].map(([low, high]) => valueRange(low, high));
        }"""
    )
    assert ranges == [[0.5, 2], [-5, 2], [-8, -7]]


def test_goal_chips_change_the_candidates_of_the_world(
    open_page: Callable[..., Page], server: str
) -> None:
    page = open_page(scene=False)
    chip = page.locator('[data-goal="cube2"]')
    before = chip.get_attribute("aria-pressed")
    chip.click()
    after = "false" if before == "true" else "true"
    expect(chip).to_have_attribute("aria-pressed", after)
    assert ("cube2" in world(server)["selected"]) == (after == "true")


def test_case_study_starts_from_its_button(open_page: Callable[..., Page], server: str) -> None:
    page = open_page(scene=False)
    page.click('[data-case="case-1"]')
    expect(page.locator('[data-case="case-1"]')).to_have_attribute("aria-pressed", "true")
    assert world(server)["case"] == "case-1"
    page.click('[data-mode="auto"]')
    expect(page.locator('[data-case="case-1"]')).to_have_attribute("aria-pressed", "false")


def test_tabs_obey_the_arrow_keys(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    page.focus("#tab-cell")
    page.keyboard.press("ArrowRight")
    expect(page.locator("#tab-training")).to_have_attribute("aria-selected", "true")
    expect(page.locator("#panel-training")).to_be_visible()


def test_address_names_the_open_tab(open_page: Callable[..., Page]) -> None:
    page = open_page(scene=False)
    page.click("#tab-training")
    page.reload()
    training = page.locator("#tab-training")
    expect(training).to_have_attribute("aria-selected", "true")
    expect(page.locator("#panel-training .card").first).to_be_visible()
    page.go_back()
    expect(training).to_have_attribute("aria-selected", "false")
    page.go_forward()
    expect(training).to_have_attribute("aria-selected", "true")


def test_page_fits_a_phone(open_page: Callable[..., Page]) -> None:
    page = open_page(PHONE, scene=False)
    wide = page.evaluate("document.documentElement.scrollWidth")
    assert wide <= PHONE[0]
    for part in (".viewer", '[data-mode="manual"]', "[data-goal]", ".bars", "#tab-training"):
        page.locator(part).first.scroll_into_view_if_needed()
        expect(page.locator(part).first).to_be_visible()


@pytest.mark.parametrize("case", ["case-2", "case-3"])
def test_case_shows_expected_observed_and_a_verdict_of_the_whole_run(
    open_page: Callable[..., Page], server: str, case: str
) -> None:
    page = open_page(scene=False)
    page.click(f'[data-case="{case}"]')
    expect(page.locator('[data-status="case done"]')).to_be_visible()
    now = world(server)
    verdict = now["verdict"]
    assert now["case"] == case
    expect(page.locator('[data-role="expected"]')).to_have_text(verdict["expected"])
    expect(page.locator('[data-role="observed"]')).to_have_text(verdict["observed"])
    agrees = "true" if verdict["as_expected"] else "false"
    shown = page.locator('[data-role="verdict"]')
    expect(shown).to_have_attribute("data-as-expected", agrees)
    tone = "chip-good" if verdict["as_expected"] else "chip-bad"
    expect(page.locator(f".story-top .{tone}")).to_be_visible()
    expect(shown.locator(f".{tone}")).to_be_visible()
    assert [one["goal"] for one in verdict["choices"]][-1] == now["chosen"]
    page.click('[data-mode="auto"]')
    expect(shown).to_have_count(0)


def test_values_carry_the_time_of_their_decision(
    open_page: Callable[..., Page], server: str
) -> None:
    page = open_page(scene=False)
    page.click('[data-action="pause"]')
    expect(page.locator(".story .chip").first).to_have_text("Paused")
    decided = world(server)["decided_s"]
    expect(page.locator('[data-role="decided"]')).to_have_text(f"at {decided:.1f} s")
