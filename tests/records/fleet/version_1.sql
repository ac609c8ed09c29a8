-- What `cnc-gateway fleet ingest` creates; every statement may be repeated.
CREATE TABLE IF NOT EXISTS boxes (
  box_id int GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  box text NOT NULL UNIQUE,            -- machine and six digits made with the history of the box
  machine text NOT NULL,               -- its name in the configuration
  first_seen timestamptz NOT NULL DEFAULT now()
);
CREATE TABLE IF NOT EXISTS series (
  series_id int GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  name text NOT NULL,
  unit text NOT NULL,                  -- symbol; 1 for pure numbers
  UNIQUE (name, unit)
);
-- One row for each item: the values of one tick that changed, or one record. A row for each value would take five times the room.
CREATE TABLE IF NOT EXISTS items (
  box_id int NOT NULL REFERENCES boxes,
  sequence bigint NOT NULL,            -- numbers of a box have no holes
  at timestamptz NOT NULL,
  kind text NOT NULL,                  -- sample, state, part, alarm, alarm_clear, decision, diagnosis, event
  historical boolean NOT NULL,         -- came after newer ones, after an outage
  series int[] NOT NULL,               -- of the numbers beside it, in the same order
  numbers float8[] NOT NULL,
  texts jsonb,                         -- {"machine_state": "cutting"}
  missing jsonb,                       -- {"coolant_temperature_c": "stale"}: no value, and why
  record jsonb,                        -- fields of a record
  PRIMARY KEY (box_id, sequence, at)
) PARTITION BY RANGE (at);
CREATE INDEX IF NOT EXISTS items_at ON items USING brin (at);
CREATE INDEX IF NOT EXISTS items_records ON items (kind, at) WHERE kind <> 'sample';
-- Messages that are no items: kept to be looked at, never in the way.
CREATE TABLE IF NOT EXISTS refused (
  received timestamptz NOT NULL DEFAULT now(),
  subject text NOT NULL,
  reason text NOT NULL,
  payload text NOT NULL
);
-- A row for each number, with its unit and machine.
CREATE OR REPLACE VIEW readings AS
  SELECT boxes.machine, boxes.box, items.at, series.name, value.number, series.unit, items.sequence
  FROM items
  CROSS JOIN LATERAL unnest(items.series, items.numbers) AS value (series_id, number)
  JOIN series ON series.series_id = value.series_id
  JOIN boxes ON boxes.box_id = items.box_id
  WHERE items.kind = 'sample';
CREATE OR REPLACE VIEW diagnoses AS
  SELECT boxes.machine, boxes.box, items.at, items.record ->> 'verdict' AS verdict, items.record ->> 'summary' AS summary,
         (items.record ->> 'json')::jsonb AS diagnosis
  FROM items JOIN boxes ON boxes.box_id = items.box_id
  WHERE items.kind = 'diagnosis';
-- What such a database held: a machine that was renamed, two days, every kind of cell, records with JSON in a text.
CREATE TABLE items_2026_01_30 PARTITION OF items FOR VALUES FROM ('2026-01-30 00:00:00+00') TO ('2026-01-31 00:00:00+00');
CREATE TABLE items_2026_01_31 PARTITION OF items FOR VALUES FROM ('2026-01-31 00:00:00+00') TO ('2026-02-01 00:00:00+00');
INSERT INTO boxes (box, machine, first_seen) VALUES ('Lathe-7-3fa9c1', 'Lathe 7', '2026-01-30'), ('Lathe-8-3fa9c1', 'Lathe 8', '2026-01-31'), ('Mill-2-00ff00', 'Mill 2', '2026-01-30');
INSERT INTO series (name, unit) VALUES ('spindle_power_w', 'W'), ('feed_mm_min', 'mm/min');
INSERT INTO items VALUES
  (1, 1, '2026-01-30 10:00:00.1+00', 'sample', false, '{1,2}', '{100.5,200}', '{"program": "O1"}', '{"coolant_temperature_c": "stale"}', NULL),
  (2, 2, '2026-01-31 10:00:00.2+00', 'sample', false, '{1}', '{101.5}', NULL, '{"feed_mm_min": "machine_off"}', NULL),
  (2, 3, '2026-01-31 10:05:00+00', 'part', false, '{}', '{}', NULL, NULL,
   '{"began_ns": 1769853600000000000, "ended_ns": 1769853900000000000, "program": "O1", "part": "", "count": 1, "energy_j": 5000, "cutting_s": 100,
     "detail": "{\"operations\": [{\"operation\": \"rough\", \"seconds\": 200, \"energy_j\": 4000}]}"}'),
  (2, 4, '2026-01-31 10:00:00+00', 'state', false, '{}', '{}', NULL, NULL, '{"state": "cutting", "program": "O1", "tool": "T1"}'),
  (2, 5, '2026-01-31 10:10:00+00', 'state', false, '{}', '{}', NULL, NULL, '{"state": "standby", "program": "", "tool": ""}'),
  (2, 6, '2026-01-31 10:10:00+00', 'event', false, '{}', '{}', NULL, NULL, '{"kind": "note", "source": "gateway", "text": "x", "detail": "plain words"}'),
  (3, 1, '2026-01-30 11:00:00+00', 'diagnosis', false, '{}', '{}', NULL, NULL, '{"verdict": "explained", "summary": "s", "json": "{\"missing\": [{\"effect\": \"friction\"}]}"}');
INSERT INTO refused VALUES ('2026-01-30', 'cnc.x', 'no document', 'payload'), ('2026-01-31', 'cnc.y', 'no document', 'payload');
