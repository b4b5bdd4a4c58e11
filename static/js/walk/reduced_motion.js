// Whether nothing may move: by the device's setting, or by the patient's own.

const reduced = matchMedia("(prefers-reduced-motion: reduce)");

export const isStill = () => reduced.matches || document.body.hasAttribute("data-still");
