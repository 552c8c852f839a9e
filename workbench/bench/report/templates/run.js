"use strict";
// The page says everything in its markup; this enlarges figures, toggles methods and tells points.

// --- enlarge ----------------------------------------------------------------------------------

const large = document.getElementById("large");
const sheet = large.querySelector(".sheet");
const pictures = [...document.querySelectorAll("button.enlarge img")];
let at = 0;

function enlarge(index) {
  at = (index + pictures.length) % pictures.length;
  const image = pictures[at].cloneNode();
  image.loading = "eager";
  sheet.replaceChildren(image);
  large.querySelector("p").textContent = image.alt;
}

document.addEventListener("click", (event) => {
  const button = event.target.closest("button.enlarge");
  if (!button) return;
  enlarge(pictures.indexOf(button.querySelector("img")));
  large.showModal();
});
large.addEventListener("click", () => large.close());
large.addEventListener("close", () => sheet.replaceChildren());
large.addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (step) enlarge(at + step);
});

// --- methods ----------------------------------------------------------------------------------

const toggles = [...document.querySelectorAll("[data-toggle]")];
const known = toggles.map((one) => one.dataset.toggle);
const off = new Set();

// The address keeps which methods are hidden.
function readHidden() {
  const part = location.hash.replace(/^#/, "").split("&").find((one) => one.startsWith("hide="));
  off.clear();
  for (const name of (part ?? "hide=").slice(5).split(",")) {
    try {
      off.add(decodeURIComponent(name));
    } catch {
      off.add(name); // not encoded by this page: taken as it is
    }
  }
  for (const name of [...off]) if (!known.includes(name)) off.delete(name);
}

function showMethods(within = document) {
  for (const part of within.querySelectorAll("[data-method]")) {
    part.classList.toggle("off", off.has(part.dataset.method));
  }
  for (const one of toggles) one.setAttribute("aria-pressed", String(!off.has(one.dataset.toggle)));
}

function keepHidden() {
  showMethods();
  quiet();
  const hidden = [...off].map(encodeURIComponent).join(",");
  history.replaceState(null, "", hidden ? `#hide=${hidden}` : "#");
}

function point(name) {
  for (const part of document.querySelectorAll(".drawing [data-method]")) {
    part.classList.toggle("faint", name !== null && part.dataset.method !== name);
  }
}

for (const one of toggles) {
  const name = one.dataset.toggle;
  one.addEventListener("click", () => {
    if (!off.delete(name)) off.add(name);
    keepHidden();
  });
  for (const event of ["pointerenter", "focus"]) one.addEventListener(event, () => point(name));
  for (const event of ["pointerleave", "blur"]) one.addEventListener(event, () => point(null));
}

if (toggles.length) {
  document.querySelector(".toggles").hidden = false;
  document.getElementById("every").addEventListener("click", () => {
    off.clear();
    keepHidden();
  });
  addEventListener("hashchange", () => {
    readHidden();
    showMethods();
  });
  readHidden();
  showMethods();
}

// --- points -----------------------------------------------------------------------------------

const tip = document.getElementById("told");
let current = null;

function words(mark) {
  const title = mark.querySelector(":scope > title");
  return mark.dataset.words ?? title?.textContent ?? mark.closest("[data-method]").dataset.method;
}

function tell(mark) {
  quiet();
  current = mark;
  mark.classList.add("told");
  tip.textContent = words(mark);
  tip.hidden = false;
  const [box, own] = [mark.getBoundingClientRect(), tip.getBoundingClientRect()];
  const left = Math.min(Math.max(box.left + box.width / 2 - own.width / 2, 8), innerWidth - own.width - 8);
  const above = box.top - own.height - 8;
  tip.style.left = `${Math.max(left, 8)}px`;
  tip.style.top = `${above > 8 ? above : box.bottom + 8}px`;
}

function quiet() {
  current?.classList.remove("told");
  current = null;
  tip.hidden = true;
}

function listen(drawing) {
  // The page tells what titles say, and at once; titles stay for those without scripts.
  for (const title of drawing.querySelectorAll("use > title")) {
    title.parentElement.dataset.words = title.textContent;
    title.remove();
  }
  const marks = () =>
    [...drawing.querySelectorAll("[data-method] use[x]")].filter((one) => !one.closest(".off"));
  const touch = (event) => {
    const mark = event.target.closest("[data-method] use[x]") ?? event.target.closest("[data-method]");
    if (mark) tell(mark);
    else quiet();
  };
  drawing.addEventListener("pointerover", touch);
  drawing.addEventListener("click", touch);
  drawing.addEventListener("pointerleave", quiet);
  drawing.addEventListener("blur", quiet);
  drawing.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === "Escape") quiet();
    if (!step) return;
    event.preventDefault();
    const all = marks();
    const place = all.indexOf(current);
    if (all.length) tell(all[(Math.max(place, step > 0 ? -1 : 0) + step + all.length) % all.length]);
  });
}
addEventListener("scroll", quiet, { passive: true });

// --- figures when they are looked at ----------------------------------------------------------

function mount(figure) {
  const template = figure.querySelector("template");
  if (!template) return;
  template.replaceWith(template.content);
  figure.querySelector(".enlarge").hidden = true;
  const drawing = figure.querySelector(".drawing");
  showMethods(drawing);
  listen(drawing);
}

const seen = new IntersectionObserver(
  (entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) continue;
      seen.unobserve(entry.target);
      mount(entry.target);
    }
  },
  { rootMargin: "600px" },
);
document.querySelectorAll("figure.toggled").forEach((figure) => seen.observe(figure));
