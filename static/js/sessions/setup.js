// The set-up: buttons that count up and down, only the goal that is asked for, a protocol's own length.

for (const step of document.querySelectorAll(".step")) {
  const field = step.querySelector("input");
  step.addEventListener("click", (event) => {
    const button = event.target.closest("button");
    if (!button) return;
    const size = Number(step.dataset.step),
      places = Number(step.dataset.places);
    // Go to the next multiple of the step: 3.91 goes to 3.95, not to 3.96.
    const now = (Number(field.value.replace(",", ".")) || 0) / size,
      up = button.value === "1";
    const next = up ? Math.floor(now + 1 + 1e-6) : Math.ceil(now - 1 - 1e-6);
    field.value = Math.max(size, next * size).toFixed(places);
  });
}

// What so many percent of the baseline were last time.
const percent = document.querySelector("input[name=goal_percent]");
const last = document.querySelector("[data-last]");
function showLast() {
  const about = last?.querySelector("output");
  const { places } = document.querySelector(".step[data-for=value]").dataset;
  if (about) about.textContent = ((last.dataset.last * Number(percent.value.replace(",", "."))) / 100).toFixed(places);
}
for (const kind of ["click", "input"]) percent.closest(".step").addEventListener(kind, showLast);
showLast();

const choices = document.querySelectorAll("input[name=goal_by]");
function showGoal() {
  const by = document.querySelector("input[name=goal_by]:checked")?.value ?? "value";
  for (const part of document.querySelectorAll("[data-for]")) part.hidden = part.dataset.for !== by;
}
choices.forEach((choice) => choice.addEventListener("change", showGoal));
showGoal();

// The goal with which the last session ended, as a value.
document.querySelector("[data-ended]")?.addEventListener("click", ({ currentTarget }) => {
  const goal = document.querySelector("input[name=goal_value]");
  goal.value = currentTarget.dataset.ended;
  document.querySelector("input[name=goal_by][value=value]").click();
  goal.focus(); // the button hides itself
});

// Start says where.
for (const choice of document.querySelectorAll("input[name=station]")) {
  choice.addEventListener("change", () => {
    document.querySelector("[data-station]").textContent = choice.closest("label").textContent.trim();
  });
}

// Another measure brings its unit, its steps and its first goal.
const measures = JSON.parse(document.getElementById("measures").textContent);
document.querySelector("select[name=measure]")?.addEventListener("change", ({ target }) => {
  const { unit, step, places, goal, better } = measures[target.value];
  const buttons = document.querySelector(".step[data-for=value]");
  Object.assign(buttons.dataset, { step, places });
  buttons.querySelector("input").value = goal;
  document.querySelector("[data-unit]").textContent = unit;
  document.querySelector("[data-better]").textContent = better;
  last?.remove();
});

// A protocol whose phases all have an end sets the minutes, and one that asks for a share of hits that share.
const targets = JSON.parse(document.getElementById("targets").textContent);
const ends = JSON.parse(document.getElementById("ends").textContent);
for (const choice of document.querySelectorAll("input[name=protocol]")) {
  const showEnd = () => (document.querySelector("[data-ends]").textContent = ends[choice.value]);
  if (choice.checked) showEnd();
  choice.addEventListener("change", () => {
    showEnd();
    for (const [name, value] of Object.entries(targets[choice.value])) {
      if (value) document.querySelector(`input[name=${name}]`).value = value;
    }
  });
}
