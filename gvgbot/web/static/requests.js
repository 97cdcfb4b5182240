// The buttons: those that the robot permits, and its answers.

const NAMES = {
  pause: "pause", resume: "resume", stop: "end exploration", home: "drive home", patrol: "patrol", coverage: "drive all edges",
  explore: "explore", relocalise: "find its place", save: "save map",
};

export class Requests {
  constructor(link) {
    this.link = link;
    this.allowed = new Set();
    this.buttons = document.querySelector("#requests");
    for (const [name, label] of Object.entries(NAMES)) this.buttons.append(this.button(name, label));
    this.form = document.querySelector("#set-form");
    this.form.addEventListener("submit", (event) => this.set(event));
  }

  button(name, label) {
    const button = document.createElement("button");
    Object.assign(button, { type: "button", textContent: label, title: `gvgbot ctl ${name}`, hidden: true });
    button.dataset.request = name;
    button.addEventListener("click", () => {
      const sure = name !== "stop" || confirm("End the exploration? The map is saved.");
      if (sure) this.ask(name, {}, label);
    });
    return button;
  }

  // Show what a state permits; nothing can be asked while the robot is out of reach.
  show(state, isReachable) {
    this.allowed = new Set(state?.requests ?? []);
    this.isReachable = isReachable;
    for (const button of this.buttons.children) {
      const name = button.dataset.request;
      button.hidden = !this.allowed.has(name);
      button.disabled = !isReachable || (name === "pause" && state?.phase === "paused") || (name === "resume" && state?.phase !== "paused");
    }
    this.form.hidden = !this.allowed.has("set");
    for (const field of this.form.elements) field.disabled = !isReachable;
    document.querySelector("#no-requests").hidden = state === null || this.allowed.size > 0;
  }

  may(name) {
    return this.allowed.has(name) && this.isReachable;
  }

  async ask(name, args, label) {
    this.answer(`${label}: asked`, "faint");
    const { done, text } = await this.link.ask(name, args);
    this.answer(`${label}: ${done ? text : `refused: ${text}`}`, done ? "good" : "bad");
  }

  answer(text, tone) {
    const line = document.querySelector("#answer");
    line.textContent = text;
    line.dataset.tone = tone;
    line.hidden = false;
  }

  set(event) {
    event.preventDefault();
    const key = document.querySelector("#set-key").value.trim(), text = document.querySelector("#set-value").value.trim();
    let value = text;
    try {
      const plain = JSON.parse(text);
      if (["number", "boolean"].includes(typeof plain)) value = plain;
    } catch { /* a word, which is a value as well */ }
    this.ask("set", { key, value }, `set ${key}`);
  }
}
