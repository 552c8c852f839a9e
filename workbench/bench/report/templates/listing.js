"use strict";
// What the table of runs decides, without the page: state and address, filter, order, columns.

const order = new Intl.Collator("en", { numeric: true });

// The state of the table as the address keeps it; unknown entries are ignored.
function readState(hash) {
  const state = { q: "", outcome: "", theme: "", sort: "" };
  for (const part of hash.replace(/^#/, "").split("&")) {
    const at = part.indexOf("=");
    const name = part.slice(0, Math.max(at, 0));
    if (!Object.hasOwn(state, name)) continue;
    try {
      state[name] = decodeURIComponent(part.slice(at + 1));
    } catch {
      state[name] = part.slice(at + 1); // not encoded by this page: taken as it is
    }
  }
  return state;
}

function writeState(state) {
  const parts = Object.entries(state).filter(([, value]) => value !== "");
  return parts.map(([name, value]) => `${name}=${encodeURIComponent(value)}`).join("&");
}

// Whether a run is shown: its theme, its outcome, and every word of the search.
function fits(run, state) {
  if (state.theme && run.theme !== state.theme) return false;
  if (state.outcome === "holds" && run.state !== "holds") return false;
  if (state.outcome === "open" && run.state === "holds") return false;
  if (state.outcome.startsWith("=") && run.outcome !== state.outcome.slice(1)) return false;
  return state.q.toLowerCase().split(/\s+/).every((word) => run.words.includes(word));
}

const asNumber = (text) => (/^-?(\d|inf)/.test(text) ? Number(text.replace("inf", "Infinity")) : NaN);

// What has no value, or none that is a number, comes last whichever way the rest is sorted.
function compareValues(a, b, numeric, sign) {
  if (numeric) [a, b] = [asNumber(a), asNumber(b)];
  const [noA, noB] = numeric ? [isNaN(a), isNaN(b)] : [a === "", b === ""];
  if (noA || noB) return noA - noB;
  return sign * (numeric ? (a > b) - (a < b) : order.compare(a, b));
}

// Parameters in which runs of one problem differ, among the runs that are shown: one column each.
// Of more than `most` there is none, and the table names them in one column.
function parameterColumns(runs, most = 4) {
  const seen = new Map();
  for (const run of runs) {
    for (const [name, value] of Object.entries(run.parameters)) {
      const place = JSON.stringify([run.problem, name]);
      if (!seen.has(place)) seen.set(place, { name, values: new Set() });
      seen.get(place).values.add(value);
    }
  }
  const names = new Set();
  for (const { name, values } of seen.values()) if (values.size > 1) names.add(name);
  return names.size <= most ? [...names] : [];
}

// A column's order after a click: ascending, descending, and then by theme again.
function nextSort(sort, column) {
  if (sort === column) return `-${column}`;
  return sort === `-${column}` ? "" : column;
}
