// The robot as a walker sees it: 2 m in front of it, eyes at 1.55 m, with a face on its mast. Each flat part is drawn
// in its own units, and laid into the picture as a plane that the eye sees.

import { shape } from "garry/shared/svg";
import { append } from "garry/shared/svg_element";
import { COLORS, FACE, showFace } from "garry/shared/robot_scene";

const EYE = [2, 0, 1.55];
const TARGET = [0, 0, 0.42];
const [HALF_M, TILE_M] = [0.6, 0.1]; // of the floor that is drawn, and of a tile
const [BASE_M, TOP_M, SCREEN_M] = [0.175, 0.125, 0.785];
const HULL_M = [0.015, 0.05, 0.09]; // heights of the discs that stand for its side
const FACE_SCALE = 1.3; // of the face as seen from above, on the screen

const minus = (a, b) => a.map((one, axis) => one - b[axis]);
const dot = (a, b) => a.reduce((sum, one, axis) => sum + one * b[axis], 0);
const unit = (a) => a.map((one) => one / Math.hypot(...a));

const AHEAD = unit(minus(TARGET, EYE));
const RIGHT = unit([AHEAD[1], -AHEAD[0], 0]);
const UP = [0, 1, 2].map(
  (axis) => RIGHT[(axis + 1) % 3] * AHEAD[(axis + 2) % 3] - RIGHT[(axis + 2) % 3] * AHEAD[(axis + 1) % 3],
);

// Return where a place of the room [m] is in the picture, whose middle is where the eye looks.
export function project(place) {
  const seen = minus(place, EYE);
  const far = dot(seen, AHEAD);
  return [dot(seen, RIGHT) / far, -dot(seen, UP) / far];
}

// Return the transform that lays a drawing's x and y along two directions of the room, its origin at a place. Exact at
// the origin; a part of the robot is small enough.
function lay(place, across, down) {
  const [x, y] = project(place);
  const reach = 0.01;
  const columns = [across, down].map((way) =>
    minus(project(place.map((one, axis) => one + reach * way[axis])), [x, y]).map((one) => one / reach),
  );
  return `matrix(${[...columns.flat(), x, y].map((one) => one.toFixed(5)).join(" ")})`;
}

const line = (from, to) => `M${project(from).join(" ")}L${project(to).join(" ")}`;

function floor() {
  let tiles = "";
  for (let at = -HALF_M; at <= HALF_M + 0.01; at += TILE_M)
    tiles += line([at, -HALF_M, 0], [at, HALF_M, 0]) + line([-HALF_M, at, 0], [HALF_M, at, 0]);
  return shape("path", { d: tiles, stroke: "currentColor", "stroke-width": 0.001, opacity: 0.3 });
}

export class WalkerView {
  #home;
  #hull;
  #mast;
  #top;
  #screen;

  constructor(svg) {
    svg.setAttribute("viewBox", "-.25 -.22 .5 .5");
    svg.innerHTML = floor();
    const add = (inside) => Object.assign(append(svg, "g"), { innerHTML: inside });
    const disc = (opacity) => shape("circle", { r: BASE_M, fill: "currentColor", opacity });
    this.#home = add(disc(0.12));
    this.#home.setAttribute("transform", lay([0, 0, 0], [0, -1, 0], [-1, 0, 0]));
    this.#hull = HULL_M.map(() => add(shape("circle", { r: BASE_M, fill: "#2a333b" })));
    this.#top = add(
      shape("circle", { r: BASE_M, fill: "#46525c" }) +
        shape("path", { d: "M-.03 -.09L0 -.15L.03 -.09Z", fill: "#f2b84b" }) +
        [-1, 1].map((side) => shape("circle", { class: "light", cx: side * 0.09, cy: -0.1, r: 0.022 })).join(""),
    );
    this.#mast = append(svg, "path");
    for (const [name, value] of Object.entries({ stroke: "#9aa6af", "stroke-width": 0.011 }))
      this.#mast.setAttribute(name, value);
    this.#screen = add(
      shape("path", { d: "M-.09 -.065h.18v.13h-.18z", fill: "#f8fbfd", stroke: "#22313a", "stroke-width": 0.006 }) +
        shape("g", { transform: `scale(${FACE_SCALE}) translate(0 .045)`, color: "#22313a" }, FACE),
    );
    this.draw({ poses: [] });
  }

  draw({ poses, lights, mood, look }) {
    const { x_m = 0, y_m = 0, heading_rad = 0 } = poses.at(-1) ?? {};
    const ahead = [Math.cos(heading_rad), Math.sin(heading_rad), 0];
    const left = [-ahead[1], ahead[0], 0];
    const back = ahead.map((one) => -one);
    const at = (z_m) => [x_m, y_m, z_m];
    for (const [index, disc] of this.#hull.entries())
      disc.setAttribute("transform", lay(at(HULL_M[index]), left, back));
    this.#top.setAttribute("transform", lay(at(TOP_M), left, back));
    this.#mast.setAttribute("d", line(at(TOP_M), at(SCREEN_M)));
    this.#screen.setAttribute("transform", lay(at(SCREEN_M), left, [0, 0, -1]));
    for (const [index, light] of this.#top.querySelectorAll(".light").entries())
      light.setAttribute("fill", COLORS[lights?.[index]] ?? "none");
    showFace(this.#screen, mood, look);
  }
}
