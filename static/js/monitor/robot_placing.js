// Buttons that drive the robot to its mark while they are held; letting go, leaving, or losing the page stops it.

const REPEAT_MS = 100; // the robot holds an order for 0.3 s

export class RobotPlacing {
  #root;
  #drive;
  #timer = 0;

  // `drive` sends an order: shares of the speeds ahead and to the left, or that it goes home by its tag.
  constructor(root, drive) {
    this.#root = root;
    this.#drive = drive;
    for (const button of root.querySelectorAll("[data-drive]")) {
      const [ahead, left] = button.dataset.drive.split(" ").map(Number);
      const order = { ahead, left, home: "home" in button.dataset };
      button.addEventListener("pointerdown", (event) => {
        if (event.isPrimary && event.button === 0) this.#hold(order);
      });
      button.addEventListener("keydown", (event) => {
        if (event.key === " " && !event.repeat) this.#hold(order);
      });
      for (const end of ["pointerup", "pointercancel", "pointerleave", "keyup", "blur", "contextmenu"])
        button.addEventListener(end, () => this.#release());
    }
    addEventListener("blur", () => this.#release());
    addEventListener("pagehide", () => this.#release());
    document.addEventListener("visibilitychange", () => this.#release());
  }

  // `knowsHome`: whether the robot has learned a tag by which it goes home.
  show(isShown, knowsHome) {
    if (!isShown) this.#release();
    this.#root.hidden = !isShown;
    this.#root.querySelector("[data-home]").hidden = !knowsHome;
  }

  get isHeld() {
    return this.#timer !== 0;
  }

  #hold(order) {
    clearInterval(this.#timer);
    this.#drive(order);
    this.#timer = setInterval(() => this.#drive(order), REPEAT_MS);
  }

  #release() {
    if (!this.#timer) return;
    clearInterval(this.#timer);
    this.#timer = 0;
    this.#drive({ ahead: 0, left: 0, home: false });
  }
}
