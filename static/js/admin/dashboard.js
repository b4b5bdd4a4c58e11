// The week in two drawings: minutes by day, hits by feedback type with what was wanted.
// The figures stand in words beside them, so the drawings are for the eye alone.

const { days, minutes, types } = JSON.parse(document.getElementById("week")?.textContent ?? "{}");
const LOW = 24,
  HIGH = 20; // room for labels below and figures above

function text(words, x, y, kind = "") {
  const safe = new Option(words).innerHTML;
  return `<text class="${kind}" x="${x}" y="${y}">${safe}</text>`;
}

function size(svg) {
  const { width, height } = svg.getBoundingClientRect();
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  return [width, height];
}

function drawMinutes(svg) {
  const [width, height] = size(svg);
  const most = Math.max(...minutes, 1),
    step = width / days.length,
    ground = height - LOW;
  const bars = minutes.map((walked, day) => {
    const tall = walked ? Math.max(3, (walked / most) * (ground - HIGH)) : 0;
    const left = step * (day + 0.18),
      middle = step * (day + 0.5);
    const bar = tall
      ? `<rect class="bar" x="${left}" y="${ground - tall}" width="${step * 0.64}" height="${tall}" rx="3"/>`
      : "";
    return (
      bar +
      (walked ? text(Math.round(walked) || "<1", middle, ground - tall - 6, "figure") : "") +
      text(days[day], middle, height - 6)
    );
  });
  svg.innerHTML = `${bars.join("")}<path class="ground" d="M0 ${ground}H${width}"/>`;
}

function drawTypes(svg) {
  const [width, height] = size(svg);
  const named = 92,
    room = width - named - 52,
    step = height / Math.max(types.length, 3);
  const x = (percent) => named + (room * percent) / 100;
  const rows = types.map(({ label, hit, wanted }, row) => {
    const middle = step * (row + 0.5),
      tall = Math.min(26, step * 0.6);
    const aim = wanted
      ? `<path class="wanted-edge" d="M${x(wanted)} ${middle - tall * 0.75}v${tall * 1.5}"/><path class="wanted" d="M${x(wanted)} ${middle - tall * 0.75}v${tall * 1.5}"/>`
      : "";
    return `${text(label, 0, middle + 5, "name")}<rect class="track" x="${named}" y="${middle - tall / 2}" width="${room}" height="${tall}" rx="3"/><rect class="bar" x="${named}" y="${middle - tall / 2}" width="${(room * hit) / 100}" height="${tall}" rx="3"/>${aim}${text(`${Math.round(hit)} %`, width, middle + 5, "share")}`;
  });
  svg.innerHTML = rows.join("");
}

if (days) {
  const drawings = { minutes: drawMinutes, types: drawTypes };
  for (const svg of document.querySelectorAll("svg[data-chart]")) {
    new ResizeObserver(() => drawings[svg.dataset.chart](svg)).observe(svg);
  }
}
