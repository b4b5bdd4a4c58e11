// The set-up: buttons that count up and down, only the goal that is asked for, a protocol's own length.

for (const step of document.querySelectorAll(".step")) {
  const field = step.querySelector("input");
  const size = Number(step.dataset.step),
    places = Number(step.dataset.places);
  step.addEventListener("click", (event) => {
    const button = event.target.closest("button");
    if (!button) return;
    // Go to the next multiple of the step: 3.91 goes to 3.95, not to 3.96.
    const now = (Number(field.value.replace(",", ".")) || 0) / size,
      up = button.value === "1";
    const next = up ? Math.floor(now + 1 + 1e-6) : Math.ceil(now - 1 - 1e-6);
    field.value = Math.max(size, next * size).toFixed(places);
  });
}

const choices = document.querySelectorAll("input[name=goal_by]");
function showGoal() {
  const by = document.querySelector("input[name=goal_by]:checked")?.value ?? "value";
  for (const step of document.querySelectorAll(".step[data-for]")) step.hidden = step.dataset.for !== by;
}
choices.forEach((choice) => choice.addEventListener("change", showGoal));
showGoal();

// A protocol whose phases all have an end sets the minutes.
const lengths = JSON.parse(document.getElementById("lengths").textContent);
for (const choice of document.querySelectorAll("input[name=protocol]")) {
  choice.addEventListener("change", () => {
    if (lengths[choice.value]) document.querySelector("input[name=minutes]").value = lengths[choice.value];
  });
}
