// The latest strides on the thermometer's own scale: a disc at or above the goal, a ring below, a gap
// where nothing was measured. The newest is larger and points to the level.
import { isStill } from "garry/walk/reduced_motion";

const SHOWN = 14;
const FLOOR = 0.5; // lower ones sit here, so that they never run into the number
const SHIFT = { duration: 260, easing: "cubic-bezier(.2, .8, .2, 1)" };

export function createDots(svg) {
  const [trace, halo, lead, group] = [".trace", ".halo", ".lead", ".dots"].map((name) => svg.querySelector(name));
  const strides = svg.querySelector(".strides");
  const dots = Array.from({ length: SHOWN }, (_, i) => {
    const dot = group.appendChild(document.createElementNS(svg.namespaceURI, "circle"));
    dot.setAttribute("r", i === SHOWN - 1 ? 17 : 11);
    return dot;
  });
  let place, newest;

  function lay({ chart: [left, right], end, y }) {
    place = { left, right, end, y, step: (right - left) / (SHOWN - 1) };
    dots.forEach((dot, i) => dot.setAttribute("cx", left + i * place.step));
  }

  // Draws entries { number, performance, hit }, oldest first.
  function draw(entries) {
    const recent = entries.slice(-SHOWN);
    const first = SHOWN - recent.length;
    let line = "";
    let joined = false;
    dots.forEach((dot, i) => {
      const { performance = null, hit } = recent[i - first] ?? {};
      const gap = performance === null;
      dot.classList.toggle("gap", gap);
      if (!gap) {
        const y = place.y(Math.max(performance, FLOOR)).toFixed(1);
        dot.setAttribute("cy", y);
        dot.classList.toggle("hit", hit);
        line += `${joined ? "L" : "M"}${place.left + i * place.step} ${y}`;
        if (i === SHOWN - 1) lead.setAttribute("d", `M${place.right + 20} ${y}H${place.end}`);
      }
      joined = !gap;
    });
    trace.setAttribute("d", line);
    halo.setAttribute("d", line);
    const last = recent.at(-1);
    if ((last?.performance ?? null) === null) lead.setAttribute("d", "");
    if (newest !== undefined && last && last.number > newest && !isStill()) {
      strides.animate([{ transform: `translateX(${place.step}px)` }, { transform: "none" }], SHIFT);
    }
    newest = last?.number ?? 0;
  }

  return { lay, draw };
}
