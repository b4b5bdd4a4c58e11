// A protocol's phases in the admin: rows that move up and down, and a drawing that is updated after each change.

import { drawProtocol } from "garry/admin/protocol_drawing";

const place = document.querySelector(".protocol-drawing");
const rows = document.querySelector("#phases-group tbody");
if (place) start();

function start() {
  const stored = JSON.parse(document.getElementById("phases").textContent);

  const phaseRows = () => (rows ? [...rows.querySelectorAll("tr.form-row:not(.empty-form)")] : []);

  const field = (row, name) => row.querySelector(`[name$="-${name}"]`);

  // A number field may hold a comma; one that holds no number counts as empty.
  function number(row, name) {
    const value = field(row, name).value.trim().replace(",", ".");
    return value && Number.isFinite(Number(value)) ? Number(value) : null;
  }

  function readPhases() {
    const edited = phaseRows().filter((row) => field(row, "kind"));
    if (!edited.length && stored.length) return stored;
    return edited
      .filter((row) => !field(row, "DELETE")?.checked && field(row, "kind").value)
      .map((row) => ({
        name: field(row, "name").value || field(row, "kind").selectedOptions[0].textContent,
        feedback: field(row, "feedback").checked,
        gain: (number(row, "gain") ?? 100) / 100,
        strides: number(row, "strides"),
        seconds: number(row, "seconds"),
      }));
  }

  function draw() {
    const { stride } = place.dataset;
    const phases = readPhases();
    place.querySelector(".about-open").hidden = phases.every(({ strides, seconds }) => strides || seconds);
    place.querySelector(".about-gain").hidden = !phases.some(({ feedback, gain }) => feedback && gain !== 1);
    place.querySelector(".total").textContent = drawProtocol(place.querySelector("svg"), phases, {
      width: Math.max(place.clientWidth - 42, 200),
      stride_s: Number(stride),
      labels: place.dataset,
    });
  }

  function renumber() {
    phaseRows().forEach((row, index) => {
      const position = field(row, "position");
      if (position) position.value = index + 1;
    });
    draw();
  }

  function createButton(label, sign, direction) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "btn small move";
    button.textContent = sign;
    button.setAttribute("aria-label", label);
    button.dataset.way = direction;
    return button;
  }

  function addButtons(row) {
    const cell = row.querySelector(".field-position");
    if (!field(row, "position") || cell.querySelector(".move")) return;
    field(row, "position").type = "hidden"; // the row's place says it
    cell.append(createButton(place.dataset.up, "↑", "up"), createButton(place.dataset.down, "↓", "down"));
  }

  function moveRow({ target }) {
    const button = target.closest?.(".move");
    if (!button) return;
    const row = button.closest("tr");
    const all = phaseRows();
    const isUp = button.dataset.way === "up";
    const neighbor = all[all.indexOf(row) + (isUp ? -1 : 1)];
    if (!neighbor) return;
    if (isUp) neighbor.before(row);
    else neighbor.after(row);
    renumber();
    button.focus();
  }

  rows?.addEventListener("click", moveRow);
  rows?.addEventListener("input", draw);
  document.addEventListener("formset:added", ({ target }) => {
    addButtons(target);
    renumber();
  });
  document.addEventListener("formset:removed", renumber);
  phaseRows().forEach(addButtons);
  new ResizeObserver(draw).observe(place);
}
