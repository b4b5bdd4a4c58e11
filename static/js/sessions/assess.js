// The stopwatch of a standard test; of a walk by laps also its distance. Both fill the form, which stays editable.

import { _, number } from "garry/shared/language";

const timer = document.getElementById("timer");

if (timer) {
  const lapTest_s = Number(timer.dataset.lapTest);
  const result = document.querySelector("[name=measured]");
  const time = timer.querySelector(".time");
  const run = timer.querySelector("[data-run]");
  const lap = timer.querySelector("[data-lap]");
  const rest = document.getElementById("rest"); // asked for once the walk is over
  let startedAt = null;
  let passed_s = 0;
  let laps = 0;

  const seconds = () => (startedAt === null ? passed_s : (performance.now() - startedAt) / 1000);
  const metersIn = (id) => Number(document.getElementById(id).value.replace(",", ".")) || 0;
  const measure = () => {
    result.value = String(laps * metersIn("lap") + metersIn("rest"));
  };

  function show() {
    const now_s = seconds();
    if (lapTest_s) {
      const left_s = Math.max(0, Math.ceil(lapTest_s - now_s));
      time.textContent = `${Math.floor(left_s / 60)}:${String(left_s % 60).padStart(2, "0")}`;
      if (startedAt !== null && now_s >= lapTest_s) stop();
    } else time.textContent = number(now_s, 1);
    if (startedAt !== null) requestAnimationFrame(show);
  }

  function start() {
    startedAt = performance.now();
    laps = passed_s = 0;
    timer.querySelector("[data-laps]")?.replaceChildren("0");
    run.textContent = _("Stop");
    run.classList.toggle("primary", !lap);
    if (lap) lap.hidden = lap.disabled = false;
    timer.scrollIntoView();
    show();
  }

  function stop() {
    passed_s = seconds();
    startedAt = null;
    run.textContent = _("Again");
    run.classList.remove("primary");
    if (lap) lap.disabled = true;
    if (rest) rest.parentElement.hidden = false;
    if (lapTest_s) measure();
    else result.value = passed_s.toFixed(2);
    show();
    timer.querySelector("[role=status]").textContent = time.textContent;
    (rest ?? result).focus();
  }

  run.addEventListener("click", () => (startedAt === null ? start() : stop()));
  lap?.addEventListener("click", () => {
    laps += 1;
    timer.querySelector("[data-laps]").textContent = laps;
    measure();
  });
  for (const id of lapTest_s ? ["lap", "rest"] : []) document.getElementById(id).addEventListener("input", measure);
  timer.hidden = false;
  show();
}
