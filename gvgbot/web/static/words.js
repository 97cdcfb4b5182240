// A robot in words: what `gvgbot monitor` says of it too, with more room.

export const LOW_BATTERY = 0.28, STUCK = 1.0, LATE = 0.1; // of a full charge; s; s

export const degrees = (angle) => `${Math.round((angle * 180) / Math.PI) + 0}°`;
const metres = (value) => (Math.round(100 * value) / 100 + 0).toFixed(2); // no -0.00
export const place = (x, y) => `${metres(x)}, ${metres(y)} m`;
export const percent = (share) => `${Math.round(100 * share)} %`;

export function duration(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  return `${Math.floor(whole / 3600)} h ${Math.floor((whole % 3600) / 60)} min`;
}

// Standard deviations of a position: [largest, its direction, smallest].
export function axes(xx, xy, yy) {
  const middle = (xx + yy) / 2, away = Math.hypot((xx - yy) / 2, xy);
  const root = (variance) => Math.sqrt(Math.max(0, variance));
  return [root(middle + away), Math.atan2(2 * xy, xx - yy) / 2, root(middle - away)];
}

export const isLost = (state) => state.covariance[0] >= 1e6; // its pose means nothing
export const sigma = (state) => (isLost(state) ? null : axes(state.covariance[0], state.covariance[1], state.covariance[4])[0]);
export const length = (metres) => (metres < 1 ? `${(100 * metres).toFixed(1)} cm` : `${metres.toFixed(2)} m`);

const counted = (count, one, many) => `${count} ${count === 1 ? one : many}`;
export const size = (vertices, edges) => `${counted(vertices, "vertex", "vertices")}, ${counted(edges, "edge", "edges")}`;

export function ofVertex(vertex) {
  const [x, y] = vertex.position, [xx, xy, , yy] = vertex.covariance, open = vertex.frontiers.length;
  const known = `${vertex.kind} ${vertex.id} at ${place(x, y)}; sigma ${length(axes(xx, xy, yy)[0])}`;
  return `${known}, clearance ${vertex.clearance.toFixed(2)} m${open ? `, ${counted(open, "frontier", "frontiers")}` : ""}`;
}

const TONES = { exploring: "good", errand: "good", waiting: "good", finished: "good", paused: "warning", starting: "warning", halted: "bad" };
// Whether it looks for its place on the map, and says why.
const isSearching = (state) => isLost(state) && ["exploring", "errand"].includes(state.phase) && state.reason !== "";
export const toneOfPhase = (state) =>
  (state.outcome && state.outcome !== "explored") || isSearching(state) ? "warning" : TONES[state.phase] ?? "plain";

// [name, text, tone] of each line, the most telling first.
export function facts(state, plan) {
  return [
    ["phase", state.phase, toneOfPhase(state)],
    ["outcome", state.outcome?.replaceAll("_", " ") ?? "none yet", state.outcome ? toneOfPhase(state) : "faint"],
    ...intention(state, plan),
    ...where(state),
    ["speed", `${metres(state.twist[0])} m/s, ${degrees(state.twist[1])}/s`, "plain"],
    ["driven", `${state.distance.toFixed(1)} m`, "plain"],
    ["map", size(state.vertices, state.edges), "plain"],
    ["frontiers", frontiers(state), "plain"],
    ["battery", ...battery(state)],
    ["laser", ...device(state.laser)],
    ["base", ...device(state.base)],
    ["control", ...control(state)],
    ["guard", state.guard ?? "free", state.guard ? "warning" : "plain"],
    ["contacts", contacts(state), state.contacts || state.slips ? "warning" : "plain"],
    ...(state.team ?? []).map(({ name, pose }) => [name, place(pose[0], pose[1]), "plain"]),
  ];
}

function where(state) {
  if (isLost(state)) return [["pose", "not known", "warning"]];
  const [x, y, theta] = state.pose, turn = Math.sqrt(Math.max(0, state.covariance[8]));
  return [
    ["pose", `${place(x, y)}, ${degrees(theta)}`, "plain"],
    ["sigma", `${length(sigma(state))}, ${((turn * 180) / Math.PI).toFixed(1)}°`, "plain"],
  ];
}

// How many are left; none is of a team that has explored all, whatever its maps lack.
function frontiers(state) {
  const isDone = state.outcome === "explored" && (state.team ?? []).length > 0 && state.frontiers > 0;
  return `${state.frontiers} ${isDone ? "followed by others" : "left"}`;
}

function intention(state, plan) {
  if (state.errand && !isSearching(state)) return [["going to", state.errand, "plain"], ["why", "somebody asked for it", "plain"]];
  if (hasReason(state)) return [["why", state.reason, "plain"]];
  if (plan?.track.length && state.vertices === 0)
    return [["going to", "the end of its first edge", "plain"], ["why", "no vertex is known", "plain"]];
  if (plan === null || plan.vertex === null) return [["going to", "nowhere yet", "faint"]];
  return [["going to", `the edge of vertex ${plan.vertex} at ${degrees(plan.bearing)}`, "plain"], ["why", plan.reason || "not said", "plain"]];
}

function battery(state) {
  if (state.battery_fraction === null) return ["unknown", "faint"];
  const voltage = state.battery_voltage === null ? "" : `, ${state.battery_voltage.toFixed(1)} V`;
  return [percent(state.battery_fraction) + voltage, state.battery_fraction < LOW_BATTERY ? "bad" : "good"];
}

function device(link) {
  if (!link.connected) return [link.messages ? "away" : "not there", "bad"];
  const said = ["lost", "damaged"].filter((name) => link[name]).map((name) => `${link[name]} ${name}`);
  if (link.reconnects) said.push(counted(link.reconnects, "reconnect", "reconnects"));
  return said.length ? [said.join(", "), "plain"] : ["fine", "good"];
}

function control(state) {
  if (state.cycle_age === null) return ["not begun", "faint"];
  return state.cycle_age > STUCK ? [`no cycle for ${duration(state.cycle_age)}`, "bad"] : ["running", "good"];
}

// The same of its program and its links; `before` is the health a moment earlier, to tell rates.
export function health(now, before) {
  if (now === undefined) return [["program", "nothing said yet", "faint"]];
  const rate = before === undefined || now.stamp <= before.stamp ? "" : `, ${((now.cycles - before.cycles) / (now.stamp - before.stamp)).toFixed(0)} per s`;
  return [
    ["program", `${percent(now.cpu)} of a core, ${(now.memory / 1e6).toFixed(0)} MB`, "plain"],
    ["up", duration(now.uptime), "plain"],
    ["cycles", `${now.cycles}${rate}`, "plain"],
    ["late", `${now.late_cycles}, slowest ${(1000 * now.slowest_cycle).toFixed(0)} ms`, now.slowest_cycle > LATE ? "warning" : "good"],
    ["laser", ...counters(now.laser, "scans")],
    ["base", ...counters(now.base, "frames")],
    ["network", now.unsent ? `${now.unsent} unsent` : "all sent", now.unsent ? "warning" : "good"],
  ];
}

function counters(link, unit) {
  const [text, tone] = device(link);
  return [`${link.messages} ${unit}, ${text}`, tone];
}

const contacts = (state) => `${state.contacts}${state.slips ? `, ${counted(state.slips, "slip", "slips")}` : ""}`;

// What to say first of a robot: [text, tone]; and whether what is shown may be wrong by now.
export function headline(link, state) {
  const span = duration(link.for_s);
  switch (link.word) {
    case "unreachable": return [`${link.trouble} (trying again)`, "bad", true];
    case "absent": return [`no robot named ${link.robot} here; there is ${link.others.join(", ") || "none"}`, "bad", true];
    case "gone": return [`robot gone for ${span}`, "bad", true];
    case "cut off":
      if (state === null) return ["connecting to the robot", "faint", false];
      return [`connection to the robot lost for ${span}, trying again`, "bad", true];
    case "quiet": return [`quiet for ${span}: its program hangs`, "bad", true];
  }
  if (link.word === "doubled") return [`several robots are named ${link.robot}: give one another robot.name`, "bad", false];
  if (state === null) return ["it has not said anything yet", "warning", false];
  if (state.cycle_age > STUCK && state.base.connected) return ["its control loop is stuck", "bad", false];
  return [doing(state), toneOfPhase(state), false];
}

// What it does, or why it does nothing.
function doing(state) {
  if (hasReason(state)) return state.reason;
  return state.phase === "errand" && state.errand ? state.errand : state.phase;
}

const hasReason = (state) => isSearching(state) || (["starting", "halted", "finished"].includes(state.phase) && state.reason !== "");

const QUIET = new Set(["edge_joined"]);
export const isTold = (event) => !QUIET.has(event.kind);

// An event as [text, tone].
export function told(event) {
  const d = event.details;
  switch (event.kind) {
    case "decision": {
      const towards = typeof d.bearing === "number" ? `, ${degrees(d.bearing)}` : "";
      return [`go to vertex ${d.vertex}${towards}: ${d.reason}`, "plain"];
    }
    case "vertex_added": return [`found ${d.kind} ${d.vertex} of degree ${d.degree}`, "plain"];
    case "vertex_removed": return [`vertex ${d.vertex} is none: ${d.reason}`, "plain"];
    case "vertex_moved": return [`vertex ${d.vertex} proves to stand elsewhere`, "plain"];
    case "loop_closed": {
      const far = typeof d.away_m === "number" ? ` after ${d.away_m.toFixed(0)} m` : "";
      return [`loop closed at vertex ${d.vertex}${far}`, "good"];
    }
    case "place_doubted": return [`vertex ${d.vertex} may be ${d.known}: the next ones tell`, "plain"];
    case "doubt_settled": return [`vertex ${d.vertex} is ${d.known ?? "a new one"}`, "plain"];
    case "closure_revoked": return [`closure at vertex ${d.vertex} taken back`, "warning"];
    case "recovery": return [`${d.action}: ${d.reason}`, "warning"];
    case "finished": return [`${d.outcome.replaceAll("_", " ")}: ${d.reason}`, d.outcome === "explored" ? "good" : "warning"];
    case "requested": return [`${d.request}${d.done ? "" : " refused"}: ${d.answer} (${d.origin})`, "plain"];
    case "errand_ended": return [`${d.errand} ${d.outcome}${d.reason ? `, ${d.reason}` : ""}`, "plain"];
    case "round_ended": return [`round ${d.round}: ${d.reached} reached, ${d.missed} missed`, "plain"];
    default: {
      const said = Object.entries(d).map(([name, value]) => `${name.replaceAll("_", " ")} ${value}`);
      return [`${event.kind.replaceAll("_", " ")}: ${said.join(", ")}`, "plain"];
    }
  }
}
