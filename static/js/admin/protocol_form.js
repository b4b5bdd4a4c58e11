// A protocol's phases: rows that move up and down, and the protocol drawn as it will be walked.

const LEAST = 58; // pixels of a phase
const place = document.querySelector(".protocol-drawing");
const rows = document.querySelector("#phases-group tbody");
if (place) follow();

function follow() {
  const drawing = place.querySelector("svg"),
    total = place.querySelector(".total");
  const stored = JSON.parse(document.getElementById("phases").textContent);
  const stride = Number(place.dataset.stride);

  function forms() {
    return rows ? [...rows.querySelectorAll("tr.form-row:not(.empty-form)")] : [];
  }

  function field(row, name) {
    return row.querySelector(`[name$="-${name}"]`);
  }

  // A number field may hold a comma; one that holds no number says nothing yet.
  function number(row, name) {
    const value = field(row, name).value.trim().replace(",", ".");
    return value && Number.isFinite(Number(value)) ? Number(value) : null;
  }

  function read() {
    const edited = forms().filter((row) => field(row, "kind"));
    if (!edited.length && stored.length) return stored;
    return edited
      .filter((row) => !field(row, "DELETE")?.checked && field(row, "kind").value)
      .map((row) => ({
        name: field(row, "name").value || field(row, "kind").selectedOptions[0].textContent,
        feedback: field(row, "feedback").checked,
        gain: number(row, "gain") ?? 1,
        strides: number(row, "strides"),
        seconds: number(row, "seconds"),
      }));
  }

  function length({ strides, seconds }) {
    const known = [seconds, strides && strides * stride].filter(Boolean);
    return known.length ? Math.min(...known) : null;
  }

  function say(seconds) {
    if (seconds === null) return place.dataset.open;
    return seconds < 90 ? `${Math.round(seconds)} s` : `${Math.round(seconds / 60)} ${place.dataset.minutes}`;
  }

  function safe(words) {
    return new Option(words).innerHTML;
  }

  // Give everybody a part of the room by weight, and nobody less than is needed to be read.
  function share(room, weights) {
    const small = new Set();
    for (;;) {
      const left = room - LEAST * small.size;
      const sum = weights.reduce((all, weight, index) => (small.has(index) ? all : all + weight), 0) || 1;
      const widths = weights.map((weight, index) => (small.has(index) ? LEAST : (weight / sum) * left));
      const more = widths.findIndex((width, index) => width < LEAST && !small.has(index));
      if (more < 0) return widths;
      small.add(more);
    }
  }

  // Widths grow with the square root, so that a block of ten minutes leaves room for one of 13 s.
  function draw() {
    const phases = read(),
      lengths = phases.map(length);
    const room = Math.max(place.clientWidth - 42, 200);
    const widths = share(
      room,
      lengths.map((seconds) => Math.sqrt(seconds ?? 300)),
    );
    const width = widths.reduce((all, one) => all + one, 0);
    let left = 0,
      drawn = "";
    phases.forEach((phase, index) => {
      const wide = widths[index],
        letters = Math.floor((wide - 12) / 8.2);
      const name = phase.name.length > letters ? `${phase.name.slice(0, Math.max(1, letters - 1))}…` : phase.name;
      const high = phase.feedback ? (92 * Math.min(Math.max(phase.gain, 0.5), 1.5)) / 1.5 + 8 : 22;
      const kind = `${phase.feedback ? "on" : "off"}${lengths[index] === null ? " endless" : ""}`;
      drawn += `<g><title>${safe(phase.name)}</title><rect class="${kind}" x="${left + 2}" y="${130 - high}" width="${wide - 4}" height="${high}" rx="4"/>`;
      drawn += `<text class="name" x="${left + 6}" y="20">${safe(name)}</text>`;
      if (phase.feedback && phase.gain !== 1)
        drawn += `<text class="gain" x="${left + wide / 2}" y="${148 - high}">×${phase.gain}</text>`;
      const words = say(lengths[index]);
      drawn += `<text class="length" x="${left + 6}" y="150">${words.length > letters ? (lengths[index] === null ? "…" : words) : safe(words)}</text></g>`;
      left += wide;
    });
    drawing.setAttribute("viewBox", `0 0 ${Math.max(width, 1)} 160`);
    drawing.setAttribute("width", Math.max(width, 1));
    drawing.innerHTML = `${drawn}<path class="ground" d="M0 131H${width}"/>`;
    const known = lengths.reduce((all, one) => all + (one ?? 0), 0);
    const open = lengths.includes(null) ? " +" : "";
    total.textContent = phases.length ? `${say(known)}${open}` : "";
  }

  function renumber() {
    forms().forEach((row, index) => {
      const position = field(row, "position");
      if (position) position.value = index + 1;
    });
    draw();
  }

  function button(label, sign, way) {
    const made = document.createElement("button");
    made.type = "button";
    made.className = "move";
    made.textContent = sign;
    made.setAttribute("aria-label", label);
    made.dataset.way = way;
    return made;
  }

  function addButtons(row) {
    const cell = row.querySelector(".field-position");
    if (!field(row, "position") || cell.querySelector(".move")) return;
    cell.append(button(place.dataset.up, "↑", "up"), button(place.dataset.down, "↓", "down"));
  }

  rows?.addEventListener("click", ({ target }) => {
    const pressed = target.closest?.(".move");
    if (!pressed) return;
    const row = pressed.closest("tr"),
      all = forms(),
      at = all.indexOf(row);
    const other = all[at + (pressed.dataset.way === "up" ? -1 : 1)];
    if (!other) return;
    if (pressed.dataset.way === "up") other.before(row);
    else other.after(row);
    renumber();
    pressed.focus();
  });
  document.addEventListener("formset:added", ({ target }) => {
    addButtons(target);
    renumber();
  });
  document.addEventListener("formset:removed", renumber);
  rows?.addEventListener("input", draw);
  forms().forEach(addButtons);
  new ResizeObserver(draw).observe(place);
}
