// Joins the parts: what comes in changes what is known, and the next frame draws it.

import { Link } from "./link.js";
import { LAYERS, MapPicture } from "./map.js";
import { extent, Plot } from "./plots.js";
import { Requests } from "./requests.js";
import { View } from "./view.js";
import * as words from "./words.js";

const $ = (id) => document.getElementById(id);
const GESTURES = "drag to move, wheel or two fingers to zoom";
const PANEL_EVERY = 150; // ms
const THEMES = ["system", "dark", "light"];

let life = null, state = null, robotLink = null, events = [], healths = [], isConnected = false, isStale = false, isFollowing = false;
let isMapDue = true, isPanelDue = true, panelAt = 0, spoken = "";

const redraw = () => { isMapDue = true; };
const view = new View($("map"), redraw, () => setFollowing(false), tap);
const picture = new MapPicture($("map"), view);
const sigmaPlot = new Plot($("sigma-plot"), words.length);
const batteryPlot = new Plot($("battery-plot"), words.percent, 1);
const link = new Link(take, (isOpen) => { isConnected = isOpen; isPanelDue = true; });
const requests = new Requests(link);

// -- what comes in ---------------------------------------------------------------------------------

function take(kind, value) {
  switch (kind) {
    case "life": if (value !== life) beginAnew(value); break;
    case "link": robotLink = value; break;
    case "history":
      sigmaPlot.set(value.stamps, value.sigmas);
      batteryPlot.set(value.stamps, value.batteries);
      break;
    case "state": takeState(value); break;
    case "map":
      picture.setMap(value);
      $("map").setAttribute("aria-label", `map, ${words.size(value.vertices.length, value.edges.length)}; ${GESTURES}`);
      break;
    case "floor": picture.setFloor(value); break;
    case "tile": picture.floor?.take(value).then(redraw); break;
    case "trajectory": picture.setTrajectory(value); break;
    case "health": healths = [...healths, value].slice(-2); break;
    case "plan": picture.plan = value; break;
    case "scan": picture.setScan(value); break;
    case "odometry": if (state === null || !words.isLost(state)) picture.setPose(value.map_base, value.stamp); break;
    case "events": events = value.events.filter(words.isTold); break;
  }
  isMapDue = true;
  isPanelDue = true;
}

// The robot's program was started again: what an earlier one said holds no more.
function beginAnew(value) {
  life = value;
  state = null;
  events = healths = [];
  picture.forget();
  $("map").setAttribute("aria-label", "map, nothing known yet");
  closePlace();
}

function takeState(value) {
  state = value;
  if (words.isLost(value)) picture.pose = null;
  else picture.setPose(value.pose, value.stamp);
  picture.covariance = value.covariance;
  picture.team = value.team ?? [];
  sigmaPlot.add(value.stamp, words.sigma(value));
  batteryPlot.add(value.stamp, value.battery_fraction);
}

// -- what is shown ---------------------------------------------------------------------------------

function frame(now) {
  requestAnimationFrame(frame);
  if (isPanelDue && now > panelAt + PANEL_EVERY) { isPanelDue = false; panelAt = now; drawPanel(); }
  if (isMapDue) { isMapDue = false; drawMap(); }
}

function drawMap() {
  if (isFollowing && picture.pose !== null) [view.x, view.y] = picture.pose;
  else if (view.isAutomatic) view.fit(picture.box());
  picture.draw();
  const metres = [1, 2, 5, 10, 20, 50, 100, 200].find((length) => length * view.scale >= 60) ?? 200;
  $("scale-bar").style.width = `${metres * view.scale}px`;
  $("scale-text").textContent = `${metres} m`;
}

function drawPanel() {
  const [text, tone, stale] = said();
  isStale = stale;
  $("robot").textContent = document.title = robotLink?.robot ?? "gvgbot";
  $("headline").textContent = text;
  $("headline").dataset.tone = tone;
  $("banner").hidden = !isStale;
  $("banner").textContent = text;
  speak(text);
  document.body.classList.toggle("stale", isStale);
  if (state !== null) {
    fill($("facts"), words.facts(state, picture.plan), factLine);
    fill($("health"), words.health(healths.at(-1), healths.at(-2)), factLine);
    $("sigma-now").textContent = words.isLost(state) ? "unknown" : words.length(words.sigma(state));
    $("battery-now").textContent = state.battery_fraction === null ? "unknown" : words.percent(state.battery_fraction);
  }
  fill($("events"), [...events].reverse(), eventLine);
  requests.show(state, isConnected && !isStale);
  drawPlace();
  const styles = getComputedStyle(document.body);
  const [first, span] = extent([sigmaPlot, batteryPlot]);
  $("plots-title").textContent = `last ${Math.round(span / 60)} min`;
  sigmaPlot.draw(styles, first, span);
  batteryPlot.draw(styles, first, span);
}

function said() {
  if (isConnected && robotLink !== null) return words.headline(robotLink, state);
  if (link.refusal) return [`${link.refusal} (trying again)`, "bad", true];
  return robotLink === null ? ["connecting", "faint", false] : ["connection to gvgbot web lost, trying again", "bad", true];
}

// For screen readers, which would read a time that runs again each second.
function speak(text) {
  const news = text.replace(/\d+ (h|min|s)\b/g, "");
  if (spoken !== news) $("spoken").textContent = text;
  spoken = news;
}

// Make the children of a list say what they should, and touch only those that change.
function fill(list, items, line) {
  while (list.children.length > items.length) list.lastChild.remove();
  items.forEach((item, i) => {
    const child = list.children[i] ?? list.appendChild(document.createElement(list.tagName === "DL" ? "div" : "li"));
    if (child.children.length === 0) child.append(...(list.tagName === "DL" ? ["dt", "dd"] : ["time", "span"]).map((tag) => document.createElement(tag)));
    const [left, right, tone] = line(item);
    if (child.children[0].textContent !== left) child.children[0].textContent = left;
    if (child.children[1].textContent !== right) child.children[1].textContent = right;
    if (child.dataset.tone !== tone) child.dataset.tone = tone;
  });
}

const factLine = (fact) => fact;

function eventLine(event) {
  const [text, tone] = words.told(event);
  return [state === null ? "" : words.duration(state.stamp - event.stamp), text, tone];
}

// -- what people do --------------------------------------------------------------------------------

let place = null; // { vertex } or { x, y } that was tapped on

function tap(px, py) {
  const vertex = picture.vertexAt(px, py), [x, y] = view.toMap(px, py);
  place = vertex === null ? { x, y } : { vertex: vertex.id };
  picture.selected = vertex?.id ?? null;
  picture.tapped = vertex === null ? [x, y] : null;
  isPanelDue = isMapDue = true;
}

function drawPlace() {
  $("place").hidden = place === null;
  if (place === null) return;
  $("place-text").textContent = placeText();
  $("place-go").hidden = !requests.may("goto");
}

function placeText() {
  if (place.vertex === undefined) return words.place(place.x, place.y);
  const vertex = picture.known?.vertices.find((one) => one.id === place.vertex);
  return vertex === undefined ? `vertex ${place.vertex} is no more` : words.ofVertex(vertex);
}

function closePlace() {
  place = picture.selected = picture.tapped = null;
  isPanelDue = isMapDue = true;
}

function goThere() {
  const label = place.vertex === undefined ? `drive to ${place.x.toFixed(1)}, ${place.y.toFixed(1)}` : `drive to vertex ${place.vertex}`;
  requests.ask("goto", place, label);
  closePlace();
}

function setFollowing(on) {
  isFollowing = on;
  $("follow").setAttribute("aria-pressed", on);
}

function fit() {
  setFollowing(false);
  view.isAutomatic = true;
  redraw();
}

function follow() {
  setFollowing(!isFollowing);
  view.isAutomatic = false;
  redraw();
}

function setTheme(name) {
  document.documentElement.dataset.theme = name;
  $("theme").textContent = `theme: ${name}`;
  try { localStorage.setItem("theme", name); } catch { /* a browser that may not keep anything */ }
  readColours();
}

function themeBefore() {
  try { return localStorage.getItem("theme"); } catch { return null; }
}

function readColours() {
  picture.setColours(getComputedStyle(document.body));
  isMapDue = isPanelDue = true;
}

function layer([name, label, colour, sign]) {
  const line = document.createElement("label"), box = document.createElement("input"), mark = document.createElement("span");
  Object.assign(box, { type: "checkbox", checked: true, id: `layer-${name}` });
  Object.assign(mark, { textContent: sign, className: `sign sign-${colour}` });
  box.addEventListener("change", () => { picture.shown[box.checked ? "add" : "delete"](name); redraw(); });
  line.append(box, mark, label);
  return line;
}

$("layers").append(...LAYERS.map(layer));
$("zoom-in").addEventListener("click", () => view.zoom(1.4));
$("zoom-out").addEventListener("click", () => view.zoom(1 / 1.4));
$("fit").addEventListener("click", fit);
$("follow").addEventListener("click", follow);
$("place-go").addEventListener("click", goThere);
$("place-close").addEventListener("click", closePlace);
$("theme").addEventListener("click", () => {
  const now = THEMES.indexOf(document.documentElement.dataset.theme);
  setTheme(THEMES[(now + 1) % THEMES.length]);
});
document.addEventListener("keydown", (event) => {
  if (event.target instanceof HTMLInputElement || event.ctrlKey || event.altKey || event.metaKey) return;
  if (event.key === "0") fit();
  else if (event.key === "f") follow();
  else if (event.key === "Escape") closePlace();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readColours);
new ResizeObserver(redraw).observe($("map"));
setTheme(THEMES.find((name) => name === themeBefore()) ?? "system");
requestAnimationFrame(frame);
