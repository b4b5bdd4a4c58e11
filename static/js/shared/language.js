// The page's language: texts from its catalog (templates/base.html loads it before any module), and
// numbers as that language writes them. Without the catalog the texts are English.
//
//   _("Goal")    n_("%(count)s step", "%(count)s steps", count)    fill(_("Hello, %(name)s."), { name })

export const language = document.documentElement.lang || "en";

const { gettext, ngettext } = globalThis; // not those of `django`, which the admin's jQuery replaces

export const _ = (text) => gettext?.(text) ?? text;

// Return the form that goes with a count, with the count (and `values`) in it.
export const n_ = (one, many, count, values = {}) =>
  fill(ngettext?.(one, many, count) ?? (count === 1 ? one : many), { count, ...values });

// Replace the placeholders of a text, %(name)s, by values.
export function fill(text, values) {
  return text.replace(/%\((\w+)\)s/g, (place, name) => values[name] ?? place);
}

const formats = new Map();

// Format a number with so many decimal places (null: those that it has) and a true minus sign.
export function number(value, places = 0) {
  if (!formats.has(places)) {
    const digits = { minimumFractionDigits: places ?? 0, maximumFractionDigits: places ?? 6 };
    formats.set(places, new Intl.NumberFormat(language, digits));
  }
  return formats.get(places).format(value).replace("-", "−");
}
