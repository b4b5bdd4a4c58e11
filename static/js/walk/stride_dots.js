// The latest strides about the goal line: a disc at or above it, a ring below, a small disc where it was close, a gap
// where nothing was measured, an arrow up or down where a step is off the chart. Few and large, to be read from 2 m;
// the newest is the largest.
import { append } from "garry/shared/svg_element";
import { isStill } from "garry/walk/reduced_motion";

const SHOWN = 6;
const SHIFT = { duration: 260, easing: "cubic-bezier(.2, .8, .2, 1)" };

export function createDots(svg) {
  const [trace, group] = [".trace", ".dots"].map((name) => svg.querySelector(name));
  const strides = svg.querySelector(".strides");
  const dots = Array.from({ length: SHOWN }, (_, i) => {
    const dot = append(group, "circle");
    dot.setAttribute("r", i === SHOWN - 1 ? 28 : 20);
    return dot;
  });
  const arrows = dots.map(() => append(group, "path"));
  let layout, newest;

  function layOut({ left, right, y, beyond }) {
    layout = { left, y, beyond, step: (right - left) / (SHOWN - 1) };
    dots.forEach((dot, i) => dot.setAttribute("cx", left + i * layout.step));
  }

  // Draw strides { number, performance, hit, close }, oldest first.
  function draw(entries) {
    const recent = entries.slice(-SHOWN);
    const first = SHOWN - recent.length;
    let line = "";
    let joined = false;
    let before = 0;
    dots.forEach((dot, i) => {
      const stride = recent[i - first] ?? {};
      const { performance = null, hit, close = false } = stride;
      const gap = performance === null;
      const beyond = gap ? 0 : layout.beyond(performance); // −1 above, 1 below
      arrows[i].setAttribute("d", "");
      dot.classList.toggle("gap", gap);
      if (!gap) {
        const y = layout.y(stride).toFixed(1);
        dot.setAttribute("cy", y);
        dot.classList.toggle("hit", hit && !close);
        dot.classList.toggle("close", close);
        const x = layout.left + i * layout.step;
        // Between two that are off on the same side nobody knows the way: no line.
        line += `${joined && !(beyond && beyond === before) ? "L" : "M"}${x} ${y}`;
        if (beyond) arrows[i].setAttribute("d", `M${x - 9} ${y - 4.5 * beyond}l9 ${9 * beyond}l9 ${-9 * beyond}`);
        arrows[i].classList.toggle("hit", hit && !close);
      }
      joined = !gap;
      before = beyond;
    });
    trace.setAttribute("d", line);
    const last = recent.at(-1);
    if (newest !== undefined && last && last.number > newest && !isStill()) {
      strides.animate([{ transform: `translateX(${layout.step}px)` }, { transform: "none" }], SHIFT);
    }
    newest = last?.number ?? 0;
  }

  return { layOut, draw };
}
