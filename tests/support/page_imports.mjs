// Lets node import the pages' modules by the names of rehab/people/web/page_scripts.py: garry/… is in static/js.
import { register } from "node:module";

const FOLDER = new URL("../../static/js/", import.meta.url).href;
const hook = `export const resolve = (name, context, next) => next(
  name.startsWith("garry/") ? ${JSON.stringify(FOLDER)} + name.slice(6) + ".js" : name, context);
export const load = (url, context, next) => next(url, url.startsWith(${JSON.stringify(FOLDER)})
  ? { ...context, format: "module" } : context);`;
register(`data:text/javascript,${encodeURIComponent(hook)}`);
