// The stream of status documents, and the watchdog: is what the page shows still true?
//
// The clock of the browser may be wrong and may jump, so it is never asked. Two clocks that only go forward are
// compared: the browser's own count of milliseconds since the page was opened, and the box's count of seconds since it
// started, which stands in every document. A document is late by as much as the difference between the two has grown
// above its least value of the last minutes: that finds a connection that delivers everything, but late.

/** Nothing older than this is shown as fresh. */
export const FRESH_MS = 2000;
const LOOK_EVERY_MS = 200;
/** The two clocks may run apart by a tenth of a per mille: in ten minutes by 60 ms. */
const BASE_EVERY_MS = 300000;

export class Live {
  constructor({ now = () => performance.now(), open = (url) => new EventSource(url) } = {}) {
    this.now = now;
    this.open = open;
    this.status = null;
    this.listeners = new Set();
    this.freshListeners = new Set();
    this.fresh = null;
    this.arrived = null;
    this.base = null;
    this.nextBase = null;
    this.limit = FRESH_MS;
  }

  start() {
    this.began = this.now();
    this.connect();
    setInterval(() => this.look(), LOOK_EVERY_MS);
  }

  connect() {
    this.stream?.close();
    this.stream = this.open("/api/v1/live");
    this.stream.addEventListener("status", (event) => this.take(JSON.parse(event.data)));
    // A stream that the server refused is not opened again by the browser.
    this.stream.onerror = () => {
      if (this.stream.readyState === 2) setTimeout(() => this.connect(), 2000);
    };
  }

  take(status) {
    const now = this.now();
    const restarted = this.status !== null && status.uptime_s < this.status.uptime_s;
    const stands = this.status !== null && !restarted && status.tick.count === this.status.tick.count;
    this.late = this.lateness(now, status.uptime_s, restarted);
    this.status = status;
    // A document that is late, or whose tick has not moved, does not make anything fresh.
    // A box that is told to look less often than every second is fresh for two and a half of its ticks.
    const tick = 1000 / (status.tick.rate_hz * (status.speed || 1));
    this.limit = Math.max(FRESH_MS, 2.5 * tick);
    if (!stands && this.late < this.limit) this.arrived = now - this.late;
    this.look();
    for (const listener of this.listeners) listener(status, restarted);
  }

  lateness(now, uptime, restarted) {
    const offset = now - uptime * 1000;
    if (this.base === null || restarted) {
      [this.base, this.nextBase, this.baseSince] = [offset, offset, now];
      return 0;
    }
    this.nextBase = Math.min(this.nextBase, offset);
    if (now - this.baseSince > BASE_EVERY_MS) [this.base, this.nextBase, this.baseSince] = [this.nextBase, offset, now];
    this.base = Math.min(this.base, offset);
    return offset - this.base;
  }

  /** Milliseconds since what is shown was true; null before anything came. */
  age() {
    return this.arrived === null ? null : this.now() - this.arrived;
  }

  look() {
    const age = this.age();
    const fresh = this.broken?.()
      ? "no"
      : age === null
        ? this.now() - this.began > 5000
          ? "no"
          : "waiting"
        : age <= this.limit
          ? "yes"
          : "no";
    this.fresh = fresh;
    for (const listener of this.freshListeners) listener(fresh, age);
  }
}
