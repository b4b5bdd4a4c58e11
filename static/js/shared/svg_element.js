// Add a new element of SVG to another one, where it stays, and return it.
export const append = (parent, name) =>
  parent.appendChild(document.createElementNS("http://www.w3.org/2000/svg", name));
