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
