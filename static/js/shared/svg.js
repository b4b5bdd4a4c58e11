// SVG drawings, as markup that is set at once.

const ESCAPES = { "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" };

const escape = (value) => String(value).replace(/[&<>"]/g, (sign) => ESCAPES[sign]);

// Return the markup of an element; `children` is markup too.
export function shape(name, attributes = {}, children = "") {
  const written = Object.entries(attributes).map(([key, value]) => ` ${key}="${escape(value)}"`);
  return `<${name}${written.join("")}>${children}</${name}>`;
}

// Return the markup of a text element. People may have typed its content: it is escaped.
export const text = (content, attributes) => shape("text", attributes, escape(content));

// Return a text that has room for so many letters, cut where it is longer.
export const fitText = (content, letters) =>
  content.length > letters ? `${content.slice(0, Math.max(1, letters - 1))}…` : content;

export const title = (content) => shape("title", {}, escape(content));

// Return the markup of one of the page's icons.
export const icon = (id) =>
  shape("svg", { class: "ic", "aria-hidden": true }, shape("use", { href: `${document.body.dataset.icons}#${id}` }));

// Let a drawing's units be pixels; return its width and height.
export function fitViewBox(svg) {
  const [width, height] = [svg.clientWidth, svg.clientHeight]; // not as the page is magnified
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  return [width, height];
}
