// Measures of an evaluation: the numbers of a row that are shown, with their names and units.
import * as format from "../format.js";

const MEASURES = [
  ["success", "success", "%"],
  ["arrived", "goal reached", "%"],
  ["finished", "finished", "%"],
  ["as_expected", "as expected", "%"],
  ["solvable", "solved by a search", "%"],
  ["collision", "collision", "%"],
  ["contact", "contact", "%"],
  ["contact_moving", "contact of the moving robot", "%"],
  ["moving_rate", "contact with a moving link", "%"],
  ["contact_at_rest", "contact at standstill", "%"],
  ["without_moving_contact", "without contact of the moving robot", "%"],
  ["timeout", "timeout", "%"],
  ["never_stopped", "never stopped by the safety layer", "%"],
  ["never_at_standstill", "never at standstill", "%"],
  ["touched_at_rest", "robot at rest touched", "%"],
  ["frozen_share", "time people stand still", "%"],
  ["exactly_minimal", "minimum number of moves", "%"],
  ["stopped", "time stopped by the safety layer", "%"],
  ["stopped_share", "time stopped by the safety layer", "%"],
  ["contacts", "contacts", ""],
  ["contacts_moving", "contacts of the moving robot", ""],
  ["moving_contacts", "contacts of the moving robot", ""],
  ["contacts_at_rest", "contacts at standstill", ""],
  ["switches_per_episode", "switches per episode", ""],
  ["moves_over_minimum", "moves / minimum", ""],
  ["time_to_success_s", "time to success", "s"],
  ["expected_time_s", "expected time to success", "s"],
  ["time_ece_s", "difference of expected times over ten bins", "s"],
  ["time_to_goal_s", "time to goal", "s"],
  ["time_s", "time to goal", "s"],
  ["time_lost_s", "time lost by the safety layer", "s"],
  ["standstill_s", "time at standstill", "s"],
  ["cycle_time_s", "cycle time", "s"],
  ["parts_per_hour", "parts per hour", ""],
  ["wrist_error_median_mm", "error of the wrists, median", "mm"],
  ["speed_rad_s", "greatest joint speed", "rad/s"],
  ["acceleration_rad_s2", "greatest joint acceleration", "rad/s²"],
];

/** Names and texts of the measures of a row, the most important ones first. */
export function measuresOf(row) {
  return MEASURES.flatMap(([key, label, unit]) => {
    const found = row[key];
    if (typeof found?.ece === "number") return calibration(label, found);
    const mean = found?.mean ?? found;
    if (typeof mean !== "number") return [];
    const hasEnds = Number.isFinite(found.low) && Number.isFinite(found.high);
    if (unit === "%") return [[label, hasEnds ? format.interval(found) : format.percent(mean)]];
    const ends = hasEnds ? ` (${format.number(found.low)} to ${format.number(found.high)})` : "";
    const average = hasEnds ? ", mean" : "";
    return [[label + average, (unit ? format.quantity(mean, unit) : counted(mean)) + ends]];
  });
}

function counted(n) {
  return Number.isInteger(n) ? format.grouped(n) : format.number(n);
}

/** Observed rate of an outcome, its predicted probability, and their difference over the bins. */
function calibration(label, { rate, mean, ece }) {
  return [[`${label}, observed`, format.percent(rate)], [`${label}, predicted`, format.percent(mean)],
    [`${label}, expected calibration error`, format.percent(ece)]];
}
