// Questions to the history: how fine for how long a time, and columns for the charts.
import { ask } from "./parts.js";

/** Spans up to so many seconds are asked for in buckets of so many seconds; 0 is every sample. The wide buckets are
    multiples of a minute, an hour and a day, which the history keeps summed up. */
const LADDER = [
  [300, 0],
  [900, 1],
  [3600, 4],
  [7200, 10],
  [172800, 60],
  [432000, 300],
  [5184000, 3600],
  [31968000, 21600],
  [Infinity, 86400],
];
/** A little more than what is looked at, so that a short pan finds data. */
const MARGIN = 0.2;
/** Rows of the audit that are writes to the machine, with the outcome of one that was made. What was only noted, refused
    or held back, or has failed, is none. */
const WRITTEN = { write: "written", stop: "sent", feed_hold: "sent" };
export const reachedMachine = (row) => row.outcome !== undefined && WRITTEN[row.kind] === row.outcome;
/** The gate was opened or closed: no write, but it stands in the list beside them. */
const gateMoved = (row) =>
  (row.kind === "armed" && row.outcome === "armed") || (row.kind === "disarmed" && row.outcome !== "was_not_armed");

export const resolutionFor = (seconds) => LADDER.find(([most]) => seconds <= most)[1];
const utc = (s) => new Date(Math.round(s * 1000)).toISOString();

export class HistoryData {
  constructor() {
    this.turn = 0;
  }

  /** Everything about a time; null where a newer question was asked meanwhile. `early` is given the samples as soon as
      they are there: the charts do not wait for sums over a year of states, nor share a processor with them. */
  async read(from, to, channels, { first, last }, early) {
    const turn = ++this.turn;
    this.abort?.abort();
    this.abort = new AbortController();
    const options = { signal: this.abort.signal };
    const width = to - from;
    const resolution = resolutionFor(width);
    const [a, b] = [Math.max(first, from - MARGIN * width), Math.min(last + 1, to + MARGIN * width)];
    const range = `from=${utc(Math.min(a, b))}&to=${utc(Math.max(a, b))}`;
    const long = width > 2.5 * 86400;
    const list = (path) =>
      ask(`/api/v1/${path}`, options).catch((error) => {
        if (error.name === "AbortError") throw error;
        return { rows: [] };
      });
    try {
      const asked = channels.length
        ? ask(`/api/v1/samples?${range}&channels=${channels.join(",")}&resolution_s=${resolution}`, options)
        : Promise.resolve({ series: [] });
      const charts = asked.then((samples) => {
        if (turn === this.turn) early({ series: samples.series, resolution, range: [a, b] });
        return samples;
      });
      const [samples, states, shares, parts, alarms, audit] = await Promise.all([
        charts,
        long ? { rows: [] } : list(`states?${range}&limit=10000`),
        long
          ? charts.then(() =>
              list(
                `utilisation?${range}&by=${width > 40 * 86400 ? "day" : "hour"}&offset_min=${-new Date(from * 1000).getTimezoneOffset()}`,
              ),
            )
          : { rows: [] },
        list(`parts?${range}&limit=${width > 30 * 86400 ? 1 : 2000}`),
        list(`alarms?${range}&limit=500`),
        long ? { rows: [] } : list(`audit?${range}&limit=500`),
      ]);
      if (turn !== this.turn) return null;
      const step = width > 40 * 86400 ? 86400 : 3600;
      return {
        resolution,
        series: samples.series,
        states: states.rows.map((s) => ({
          from: s.from_ms / 1000,
          to: (s.to_ms ?? last * 1000) / 1000,
          word: s.state,
        })),
        shares: shares.rows.map((r) => ({ from: r.from_ms / 1000, to: r.from_ms / 1000 + step, seconds: r.seconds })),
        parts: parts.rows,
        partsCut: parts.truncated,
        alarms: alarms.rows,
        writes: audit.rows.filter((row) => reachedMachine(row) || gateMoved(row)),
      };
    } catch (error) {
      if (error.name === "AbortError" || turn !== this.turn) return null;
      throw error;
    }
  }
}

/** Columns for a chart of these channels: x in seconds, then mean, least, greatest of each. */
export function columns(series, names) {
  const found = names.map((name) => series.find((s) => s.channel === name));
  const x = (found.find(Boolean)?.points ?? []).map((p) => p[0] / 1000);
  const data = [x];
  for (const one of found) {
    const points = one?.points ?? [];
    const number = (v) => (typeof v === "number" ? v : null);
    const banded = points.some((p) => p.length > 3 && p[2] !== p[3]);
    data.push(
      x.map((_, at) => number(points[at]?.[1])),
      x.map((_, at) => (banded ? number(points[at]?.[2]) : null)),
      x.map((_, at) => (banded ? number(points[at]?.[3]) : null)),
    );
  }
  return data;
}

/** What is seen, as a table for a spreadsheet: one line per time, least and greatest where there are buckets. */
export function csv(series, from, to) {
  const rows = new Map();
  const head = ["time_utc"];
  series.forEach((one, at) => {
    const banded = one.points.some((p) => p.length > 3);
    head.push(one.channel, ...(banded ? [`${one.channel}_min`, `${one.channel}_max`] : []));
    const begin = head.indexOf(one.channel);
    for (const p of one.points) {
      const s = p[0] / 1000;
      if (s < from || s > to) continue;
      const row = rows.get(p[0]) ?? [];
      row[begin - 1] = p[1];
      if (banded) {
        row[begin] = p[2];
        row[begin + 1] = p[3];
      }
      rows.set(p[0], row);
    }
    void at;
  });
  const cell = (v) =>
    v === null || v === undefined ? "" : /[",\n]/.test(String(v)) ? `"${String(v).replaceAll('"', '""')}"` : String(v);
  const lines = [...rows]
    .sort((a, b) => a[0] - b[0])
    .map(([ms, row]) => [new Date(ms).toISOString(), ...head.slice(1).map((_, at) => cell(row[at]))].join(","));
  return [head.join(","), ...lines].join("\n") + "\n";
}

export function download(name, text, type = "text/csv") {
  const url = URL.createObjectURL(new Blob([text], { type }));
  const link = document.createElement("a");
  [link.href, link.download] = [url, name];
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}
