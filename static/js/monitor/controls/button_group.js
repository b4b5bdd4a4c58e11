// Buttons of which one is pressed: it has the value that is in force.

export function markPressed(group, value) {
  for (const button of group.querySelectorAll("button")) {
    const isPressed = button.value === String(value);
    button.classList.toggle("on", isPressed);
    button.setAttribute("aria-pressed", isPressed);
  }
}
