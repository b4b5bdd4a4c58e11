// The robot's way in its own frame: home in the middle, ahead is up; 1.5 m wide.

import { number } from "garry/shared/language";
import { shape, text } from "garry/shared/svg";

const HOME = shape("circle", { class: "home-spot", r: 0.18 });
const SCALE =
  shape("path", { class: "scale", d: "M-0.7 0.44h0.5M-0.7 0.41v0.06M-0.2 0.41v0.06" }) +
  text(`${number(0.5, 1)} m`, { class: "scale-words", x: -0.45, y: 0.39 });
const BASE = shape("circle", { class: "base", r: 0.175 }) + shape("path", { class: "nose", d: "M0 -0.04V-0.14" });

const point = ({ x_m: x, y_m: y }) => `${(-y).toFixed(3)} ${(-x).toFixed(3)}`;

function drawBase(pose) {
  const degrees = (-pose.heading_rad * 180) / Math.PI;
  return shape("g", { transform: `translate(${point(pose)}) rotate(${degrees.toFixed(1)})` }, BASE);
}

// Draw the robot where it is, behind it the poses that it had, oldest first.
export function drawTrail(svg, poses) {
  const way = poses.length > 1 ? shape("path", { class: "way", d: `M${poses.map(point).join("L")}` }) : "";
  svg.innerHTML = HOME + SCALE + way + (poses.length ? drawBase(poses.at(-1)) : "");
}
