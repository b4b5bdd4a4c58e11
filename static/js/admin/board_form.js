// The form of a leaderboard: hides what does not apply, keeps choices consistent, and shows the board as it
// would be after each change.

import { showPreview } from "garry/admin/form_preview";

const SUMS = ["steps", "score", "active_minutes", "attended", "target_met"];
const COUNTED = ["attended", "target_met"];

const form = document.querySelector("#leaderboard_form");
const preview = document.querySelector(".preview");
if (form && preview) start();

function start() {
  const facts = preview.querySelector(".facts");

  function value(name) {
    const field = form.elements[name];
    return field && "value" in field ? field.value : "";
  }

  function set(name, wanted) {
    const field = form.elements[name];
    if (field && value(name) !== wanted) field.value = wanted;
  }

  function show(name, wanted) {
    const field = form.querySelector(`.field-${name}`);
    if (field) field.hidden = !wanted;
  }

  // Keep what was just chosen, and adjust the settings that contradict it.
  function adjustOthers(changed) {
    const own = value("among") === "self";
    const total = value("display") === "total";
    if (changed === "metric" && COUNTED.includes(value("metric"))) {
      if (own) set("among", "clinic");
      set("aggregation", "sum");
    }
    if (changed === "display" && total && own) set("among", "clinic");
    if (changed === "display" && total) {
      set("aggregation", "sum");
      if (!SUMS.includes(value("metric"))) set("metric", "active_minutes");
    }
    if (changed === "among") {
      if (own) set("aggregation", "each");
      else if (value("aggregation") === "each") set("aggregation", "best");
      if (own && total) set("display", "neighbors");
    }
    if (changed === "occasion" && value("occasion") === "waiting") {
      if (value("among") === "self") set("among", "clinic");
      if (value("aggregation") === "each") set("aggregation", "best");
      if (!["top", "total"].includes(value("display"))) set("display", "top");
      if (value("types") === "same") set("types", "all");
    }
    if (changed === "metric" && value("aggregation") === "sum" && !SUMS.includes(value("metric"))) {
      set("aggregation", value("among") === "self" ? "each" : "best");
      if (total) set("display", "neighbors");
    }
  }

  function updateVisibility() {
    const own = value("among") === "self";
    const [display, aggregation] = [value("display"), value("aggregation")];
    show("group", value("among") === "group");
    show("aggregation", !own);
    show("mean_of", aggregation === "mean");
    show("valences", value("types") === "chosen");
    show("period_from", value("period") === "dates"); // the row of both dates
    show("top_n", display === "top" || display === "top_and_me");
    show("total_goal", display === "total");
    show("show_ranks", display !== "total");
    show("names", !own && display !== "total");
    show("min_participants", !own);
  }

  form.addEventListener("change", ({ target }) => {
    adjustOthers(target.name);
    updateVisibility();
  });
  updateVisibility();
  showPreview(form, preview, (drawn) => {
    const told = drawn.body?.dataset.facts?.trim() ?? "";
    facts.textContent = drawn.body?.textContent.includes(told) ? "" : told; // a board without rows says it itself
  });
}
