// How the patient walks: belt speed, body-weight support, what helps; noted here or reported by the treadmill.

const BY = { belt_speed: 0.1, weight_support: 5 };

export function createWalking({ onPress, remark }) {
  const inputs = [...document.querySelectorAll(".walking input")];
  const helps = [...document.querySelectorAll(".walking [data-help]")];

  function note(kind, value) {
    const { max } = document.getElementById(kind);
    remark(kind, Number(Math.min(Number(max), Math.max(0, value)).toFixed(2)));
  }

  const move = (kind, { conditions }, ways) => note(kind, (conditions[kind] ?? 0) + ways * BY[kind]);
  onPress("[data-less]", ({ dataset }, session) => move(dataset.less, session, -1));
  onPress("[data-more]", ({ dataset }, session) => move(dataset.more, session, 1));
  onPress("[data-help]", ({ dataset }, { conditions }) => remark(dataset.help, conditions[dataset.help] ? 0 : 1));
  for (const input of inputs) {
    input.addEventListener("change", () => input.value !== "" && note(input.id, input.valueAsNumber));
  }

  return {
    draw({ conditions }) {
      for (const input of inputs) if (input !== document.activeElement) input.value = conditions[input.id] ?? "";
      for (const help of helps) {
        const isOn = Boolean(conditions[help.dataset.help]);
        help.classList.toggle("on", isOn);
        help.setAttribute("aria-pressed", isOn);
      }
    },
    events: {
      remark(session, { what, value }) {
        session.conditions[what] = value;
      },
    },
  };
}
