// Whether nothing may move: the device says so, or the patient's own settings.

const reduced = matchMedia("(prefers-reduced-motion: reduce)");

export const isStill = () => reduced.matches || document.body.hasAttribute("data-still");
