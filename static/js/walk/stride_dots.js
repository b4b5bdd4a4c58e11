// The latest strides on the thermometer's own scale: a disc at or above the goal, a ring below, a small
// disc where it was close, a gap where nothing was measured. The newest is larger and points to the level.
import { append } from "garry/shared/svg";
import { isStill } from "garry/walk/reduced_motion";

const SHOWN = 14;
const LOWEST = 0.5; // lower ones sit here, so that they never run into the number
const SHIFT = { duration: 260, easing: "cubic-bezier(.2, .8, .2, 1)" };

export function createDots(svg) {
  const [trace, halo, lead, group] = [".trace", ".halo", ".lead", ".dots"].map((name) => svg.querySelector(name));
  const strides = svg.querySelector(".strides");
  const dots = Array.from({ length: SHOWN }, (_, i) => {
    const dot = append(group, "circle");
    dot.setAttribute("r", i === SHOWN - 1 ? 17 : 11);
    return dot;
  });
  let layout, newest;

  function layOut({ chart: [left, right], end, y }) {
    layout = { left, right, end, y, step: (right - left) / (SHOWN - 1) };
    dots.forEach((dot, i) => dot.setAttribute("cx", left + i * layout.step));
  }

  // Draw strides { number, performance, hit, close }, oldest first.
  function draw(entries) {
    const recent = entries.slice(-SHOWN);
    const first = SHOWN - recent.length;
    let line = "";
    let joined = false;
    dots.forEach((dot, i) => {
      const { performance = null, hit, close = false } = recent[i - first] ?? {};
      const gap = performance === null;
      dot.classList.toggle("gap", gap);
      if (!gap) {
        const y = layout.y(Math.max(performance, LOWEST)).toFixed(1);
        dot.setAttribute("cy", y);
        dot.classList.toggle("hit", hit && !close);
        dot.classList.toggle("close", close);
        line += `${joined ? "L" : "M"}${layout.left + i * layout.step} ${y}`;
        if (i === SHOWN - 1) lead.setAttribute("d", `M${layout.right + 20} ${y}H${layout.end}`);
      }
      joined = !gap;
    });
    trace.setAttribute("d", line);
    halo.setAttribute("d", line);
    const last = recent.at(-1);
    if ((last?.performance ?? null) === null) lead.setAttribute("d", "");
    if (newest !== undefined && last && last.number > newest && !isStill()) {
      strides.animate([{ transform: `translateX(${layout.step}px)` }, { transform: "none" }], SHIFT);
    }
    newest = last?.number ?? 0;
  }

  return { layOut, draw };
}
