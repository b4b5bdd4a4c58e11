// The page's language: words from its catalog (templates/base.html loads it before any module), and
// numbers as they are written there. Without the catalog the words are English.
//
//   _("Goal")    n_("%(count)s step", "%(count)s steps", count)    fill(_("Hello, %(name)s."), { name })

export const language = document.documentElement.lang || "en";

const { django } = globalThis;

export const _ = (text) => django?.gettext?.(text) ?? text;

// Picks the form that goes with a count, and puts the count (and `values`) into it.
export const n_ = (one, many, count, values = {}) =>
  fill(django?.ngettext?.(one, many, count) ?? (count === 1 ? one : many), { count, ...values });

// Puts values into the places that a text has for them: %(name)s.
export function fill(text, values) {
  return text.replace(/%\((\w+)\)s/g, (place, name) => values[name] ?? place);
}

const formats = new Map();

// Writes a number with so many decimal places (null: those that it has); its minus is a true one.
export function number(value, places = 0) {
  if (!formats.has(places)) {
    const digits = { minimumFractionDigits: places ?? 0, maximumFractionDigits: places ?? 6 };
    formats.set(places, new Intl.NumberFormat(language, digits));
  }
  return formats.get(places).format(value).replace("-", "−");
}
