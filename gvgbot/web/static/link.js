// The connection to the server: made again whenever it is lost, or has been silent for too long.

import { decode } from "./msgpack.js";

const SILENCE = 4000, FIRST_PAUSE = 500, LONGEST_PAUSE = 5000; // ms

export class Link {
  constructor(onMessage, onChange) {
    this.onMessage = onMessage;
    this.onChange = onChange;
    this.isOpen = false;
    this.refusal = ""; // why the server closed it
    this.pause = FIRST_PAUSE;
    this.waiting = new Map();
    this.number = 0;
    this.connect();
    setInterval(() => this.watch(), 1000);
    document.addEventListener("visibilitychange", () => this.watch());
  }

  connect() {
    clearTimeout(this.retry);
    this.retry = null;
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = (this.socket = new WebSocket(`${scheme}://${location.host}/live`));
    socket.binaryType = "arraybuffer";
    this.heardAt = performance.now();
    socket.onmessage = (event) => {
      if (socket !== this.socket) return;
      this.heardAt = performance.now();
      this.pause = FIRST_PAUSE;
      this.refusal = "";
      this.open();
      const [kind, value] = decode(event.data);
      if (kind === "reply") this.settle(value);
      else this.onMessage(kind, value);
    };
    socket.onclose = ({ reason }) => { if (socket === this.socket) this.lose(reason); };
  }

  watch() {
    if (this.retry === null && performance.now() - this.heardAt > SILENCE) this.lose();
  }

  lose(refusal = "") {
    const socket = this.socket;
    this.refusal = refusal;
    this.socket = null;
    socket?.close();
    for (const id of [...this.waiting.keys()]) {
      this.settle({ id, done: false, text: "the connection was lost before an answer came" });
    }
    this.isOpen = false;
    this.onChange(false);
    this.retry = setTimeout(() => this.connect(), this.pause);
    this.pause = Math.min(2 * this.pause, LONGEST_PAUSE);
  }

  open() {
    if (this.isOpen) return;
    this.isOpen = true;
    this.onChange(true);
  }

  // What the robot answers: { done, text }.
  ask(name, args = {}) {
    if (this.socket?.readyState !== WebSocket.OPEN) {
      return Promise.resolve({ done: false, text: "there is no connection" });
    }
    const id = ++this.number;
    this.socket.send(JSON.stringify({ id, name, arguments: args }));
    return new Promise((resolve) => this.waiting.set(id, resolve));
  }

  settle(reply) {
    this.waiting.get(reply.id)?.(reply);
    this.waiting.delete(reply.id);
  }
}
