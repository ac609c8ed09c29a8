// Decodes Sparkplug payloads with the library of Eclipse Tahu (npm sparkplug-payload): a payload in hexadecimal digits per line of standard
// input, one JSON document per line of output. A metric without a datatype, as in data, has no value for this library.

const payloads = require("sparkplug-payload").get("spBv1.0");
const plain = (value) => (value !== null && typeof value === "object" && "toNumber" in value ? value.toNumber() : (value ?? null));

for (const line of require("fs").readFileSync(0, "utf8").trim().split("\n")) {
  const payload = payloads.decodePayload(Buffer.from(line, "hex"));
  const metrics = payload.metrics.map((metric) => ({
    name: metric.name ?? null,
    alias: plain(metric.alias),
    type: metric.type ? metric.type.toUpperCase() : null,
    value: plain(metric.value),
    timestamp: plain(metric.timestamp),
    properties: Object.fromEntries(Object.entries(metric.properties ?? {}).map(([name, { value }]) => [name, plain(value)])),
  }));
  console.log(JSON.stringify({ seq: plain(payload.seq), timestamp: plain(payload.timestamp), metrics }));
}
