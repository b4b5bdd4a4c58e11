// The robot from above, in its own frame: home in the middle, ahead is up. Drawn once; then what moves is moved.

import { _, number } from "garry/shared/language";
import { shape, text } from "garry/shared/svg";
import { append } from "garry/shared/svg_element";

const TETHER_M = 0.3; // it never leaves this circle (docs/safety.md)
const BASE_M = 0.175;
const HALF_M = 0.5; // of the drawing, to each side
const MOVE_MS = 250; // between two reports of a robot that moves
export const COLORS = { off: "none", green: "#1f9d55", orange: "#e0861a", red: "#d03434" };
// The mouth of each look (robot/motion/face_and_arms.py), seen as the robot's face is seen by who stands before it.
const MOUTHS = {
  calm: "M-.045 -.02h.09",
  smile: "M-.05 -.03q.05 .05 .1 0",
  laugh: "M-.055 -.035q.055 .1 .11 0Z",
  sad: "M-.055 0q.055 -.07 .11 0",
  small: "M-.015 -.02h.03",
  wry: "M-.045 -.015q.05 .01 .08 -.025",
};
const OF_MOODS = { glad: "laugh", sad: "sad" }; // where no look is known
const EYE_M = 0.014;

const FLOOR =
  shape("circle", {
    class: "tether",
    r: TETHER_M,
    fill: "none",
    stroke: "currentColor",
    "stroke-width": 0.006,
    "stroke-dasharray": ".025 .018",
    opacity: 0.6,
  }) + shape("path", { d: "M-.03 0h.06M0 -.03v.06", stroke: "currentColor", "stroke-width": 0.006, opacity: 0.6 });

const SCALE = shape("path", {
  d: "M.26 .46h.2M.26 .44v.04M.46 .44v.04",
  stroke: "currentColor",
  "stroke-width": 0.006,
  opacity: 0.6,
});

const label = (words, x, y) =>
  text(words, {
    class: "scene-words",
    x,
    y,
    "font-size": 0.05,
    "text-anchor": "middle",
    fill: "currentColor",
    opacity: 0.8,
  });

// The treadmill stands for the walker's side; how far away it is, is not drawn to scale.
const treadmill = () =>
  shape("rect", {
    class: "treadmill",
    x: -0.5,
    y: 0.36,
    width: 0.42,
    height: 0.14,
    rx: 0.02,
    fill: "currentColor",
    opacity: 0.14,
  }) +
  shape("path", { d: "M-.46 .39h.34M-.46 .48h.34", stroke: "currentColor", "stroke-width": 0.004, opacity: 0.4 }) +
  label(_("treadmill"), -0.29, 0.45);

export const FACE =
  shape("ellipse", { class: "eye", cx: -0.03, cy: -0.065, rx: EYE_M, ry: EYE_M, fill: "currentColor" }) +
  shape("ellipse", { class: "eye", cx: 0.03, cy: -0.065, rx: EYE_M, ry: EYE_M, fill: "currentColor" }) +
  shape("path", {
    class: "mood",
    fill: "none",
    stroke: "currentColor",
    "stroke-width": 0.014,
    "stroke-linecap": "round",
  });

const BASE =
  shape("circle", { r: BASE_M, fill: "currentColor", opacity: 0.22 }) +
  shape("path", { class: "heading", d: `M-.05 -.13L0 -.215L.05 -.13Z`, fill: "currentColor" }) +
  shape("circle", { class: "light", cx: -0.07, cy: -0.075, r: 0.026, stroke: "currentColor", "stroke-width": 0.006 }) +
  shape("circle", { class: "light", cx: 0.07, cy: -0.075, r: 0.026, stroke: "currentColor", "stroke-width": 0.006 }) +
  FACE;

// Let a drawing of `FACE` show a look (a mouth, and how far its eyes are open), or else a mood.
export function showFace(drawing, mood, look) {
  const [mouth, open] = look ?? [OF_MOODS[mood], 1];
  const drawn = drawing.querySelector(".mood");
  drawn.dataset.mood = mood ?? "calm";
  drawn.dataset.look = mouth ?? "calm";
  drawn.setAttribute("d", MOUTHS[mouth] ?? MOUTHS.calm);
  for (const eye of drawing.querySelectorAll(".eye"))
    eye.setAttribute("ry", EYE_M * Math.max(Math.min(open, 1.2), 0.2));
}

const point = ({ x_m: x, y_m: y }) => `${(-y).toFixed(4)} ${(-x).toFixed(4)}`;

export class RobotScene {
  #way;
  #base;
  #lights;
  #corners;

  // `isFollowed`: whether reports come now and then, so that it glides from one to the next.
  constructor(svg, { isFollowed = true } = {}) {
    svg.setAttribute("viewBox", `${-HALF_M} ${-HALF_M} ${2 * HALF_M} ${2 * HALF_M}`);
    svg.innerHTML = FLOOR;
    this.#corners = append(svg, "g");
    this.#drawCorners(1);
    this.#way = append(svg, "path");
    for (const [name, value] of Object.entries({
      class: "trail",
      fill: "none",
      stroke: "#2c7be5",
      "stroke-width": 0.016,
      "stroke-linecap": "round",
      "stroke-linejoin": "round",
      opacity: 0.75,
    }))
      this.#way.setAttribute(name, value);
    this.#base = append(svg, "g");
    this.#base.setAttribute("class", "robot-base");
    this.#base.innerHTML = BASE;
    this.#lights = this.#base.querySelectorAll(".light");
    const isCalm = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.#base.style.transition = isCalm || !isFollowed ? "none" : `transform ${MOVE_MS}ms linear`;
    this.draw({ poses: [] });
  }

  #drawCorners(share) {
    this.#corners.innerHTML = SCALE + treadmill() + label(`${number(0.2 * share, 1)} m`, 0.36, 0.43);
    this.#corners.setAttribute("transform", `scale(${share})`);
  }

  // Show a share of the floor around home, without the empty floor ahead; the tether only where it is in the drawing.
  zoom(svg, share) {
    svg.setAttribute("viewBox", [-HALF_M, -0.9 * HALF_M, 2 * HALF_M, 1.9 * HALF_M].map((one) => one * share).join(" "));
    svg.querySelector(".tether").style.display = share < 1 ? "none" : "";
    this.#drawCorners(share);
  }

  // `poses`: those that it had, oldest first; `lights`: two colors; `mood`: calm, glad or sad; `look`: which mouth, and
  // how far its eyes are open.
  draw({ poses, lights, mood, look }) {
    const { x_m = 0, y_m = 0, heading_rad = 0 } = poses.at(-1) ?? {};
    this.#base.style.opacity = poses.length ? 1 : 0.35;
    // In units of the drawing, which CSS calls pixels.
    this.#base.style.transform = `translate(${-y_m}px, ${-x_m}px) rotate(${-heading_rad}rad)`;
    this.#base.dataset.pose = `${x_m.toFixed(3)} ${y_m.toFixed(3)} ${heading_rad.toFixed(3)}`;
    this.#way.setAttribute("d", poses.length > 1 ? `M${poses.map(point).join("L")}` : "");
    for (const [index, light] of this.#lights.entries()) {
      light.dataset.color = lights?.[index] ?? "off";
      light.setAttribute("fill", COLORS[light.dataset.color] ?? "none");
    }
    showFace(this.#base, mood, look);
  }
}
