-- Version 5. What `cnc-gateway fleet ingest` creates. Times are those of the machines; `arrived` is when the stream had the item.
CREATE TABLE fleet_schema (
  version int PRIMARY KEY,
  since timestamptz NOT NULL DEFAULT now()
);
CREATE TABLE boxes (
  box_id int GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  box text NOT NULL UNIQUE,            -- made once with the history of the box; a machine that is renamed keeps it
  machine text NOT NULL,               -- newest name of the machine; every name is in box_names
  named_at timestamptz NOT NULL,       -- since when it has this name
  first_seen timestamptz NOT NULL DEFAULT now()
);
CREATE TABLE box_names (
  box_id int NOT NULL REFERENCES boxes ON DELETE CASCADE,
  since timestamptz NOT NULL,
  machine text NOT NULL,
  PRIMARY KEY (box_id, since)
);
CREATE TABLE series (
  series_id int GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
  name text NOT NULL,
  unit text NOT NULL,                  -- symbol; 1 for pure numbers, empty for texts
  UNIQUE (name, unit)
);
-- One row for each item as it came: the values of one tick that changed, a record, a gap; of means only that they have come.
-- `series` names the numbers first, then the texts, then what is missing.
CREATE TABLE items (
  sequence bigint NOT NULL,            -- numbers of a box have no holes
  epoch bigint NOT NULL DEFAULT 0,     -- which life of the box has numbered it: a copy that is put back uses numbers once more
  at timestamptz NOT NULL,             -- to the microsecond
  at_ns bigint NOT NULL,               -- the same to the nanosecond, since 1970
  arrived timestamptz NOT NULL,
  box_id int NOT NULL,
  historical boolean NOT NULL,         -- came after newer ones, after an outage
  redated_ns bigint NOT NULL DEFAULT 0, -- by how much its time was moved, because the clock of the box had been wrong
  kind text NOT NULL,                  -- sample, state, part, alarm, alarm_clear, decision, diagnosis, event, fact, gap, minute, hour, day
  series int[],
  numbers float8[],
  texts text[],
  reasons text[],                      -- why there is no value: stale, machine_off, ...
  record jsonb,
  PRIMARY KEY (box_id, at, sequence, epoch)
) PARTITION BY RANGE (at);
CREATE INDEX items_at ON items USING brin (at);
-- Messages that are no items, or that the database does not take: kept to be looked at, never in the way.
CREATE TABLE refused (
  received timestamptz NOT NULL DEFAULT now(),
  stream_sequence bigint NOT NULL,
  subject text NOT NULL,
  reason text NOT NULL,
  payload text NOT NULL                -- its first letters
);
CREATE UNIQUE INDEX refused_once ON refused (stream_sequence, md5(subject));
-- The newest value of every series of a box: {"series_id": [microseconds since 1970, value, why there is none]}.
CREATE TABLE box_latest (
  box_id int PRIMARY KEY REFERENCES boxes ON DELETE CASCADE,
  last_at timestamptz NOT NULL,
  last_arrival timestamptz NOT NULL,
  last_sequence bigint NOT NULL,
  cells jsonb NOT NULL
) WITH (fillfactor = 50);
-- Means by time, made on the box. A row holds the 60 minutes of an hour, the 24 hours of a day, the days of a month; `seconds` is for how
-- long there was a value, 0 where none has come.
CREATE TABLE minute_means (
  series_id int NOT NULL, box_id int NOT NULL, hour timestamptz NOT NULL,
  mean real[] NOT NULL, least real[] NOT NULL, greatest real[] NOT NULL, seconds real[] NOT NULL,
  PRIMARY KEY (series_id, box_id, hour)
) PARTITION BY RANGE (hour);
CREATE TABLE hour_means (
  series_id int NOT NULL, box_id int NOT NULL, day timestamptz NOT NULL,
  mean real[] NOT NULL, least real[] NOT NULL, greatest real[] NOT NULL, seconds real[] NOT NULL,
  PRIMARY KEY (series_id, box_id, day)
) PARTITION BY RANGE (day);
CREATE TABLE day_means (
  series_id int NOT NULL, box_id int NOT NULL, month timestamptz NOT NULL,
  mean real[] NOT NULL, least real[] NOT NULL, greatest real[] NOT NULL, seconds real[] NOT NULL,
  PRIMARY KEY (series_id, box_id, month)
) PARTITION BY RANGE (month);
-- Compressed within the row, never beside it.
ALTER TABLE minute_means ALTER COLUMN mean SET STORAGE MAIN;
ALTER TABLE minute_means ALTER COLUMN least SET STORAGE MAIN;
ALTER TABLE minute_means ALTER COLUMN greatest SET STORAGE MAIN;
ALTER TABLE minute_means ALTER COLUMN seconds SET STORAGE MAIN;
ALTER TABLE hour_means ALTER COLUMN mean SET STORAGE MAIN;
ALTER TABLE hour_means ALTER COLUMN least SET STORAGE MAIN;
ALTER TABLE hour_means ALTER COLUMN greatest SET STORAGE MAIN;
ALTER TABLE hour_means ALTER COLUMN seconds SET STORAGE MAIN;
ALTER TABLE day_means ALTER COLUMN mean SET STORAGE MAIN;
ALTER TABLE day_means ALTER COLUMN least SET STORAGE MAIN;
ALTER TABLE day_means ALTER COLUMN greatest SET STORAGE MAIN;
ALTER TABLE day_means ALTER COLUMN seconds SET STORAGE MAIN;
-- Stretches of a machine state. `no_data`: the box was stopped, off, or had no samples.
CREATE TABLE state_list (
  sequence bigint NOT NULL,
  since timestamptz NOT NULL,
  until timestamptz,                   -- empty: it is the newest
  box_id int NOT NULL,
  epoch bigint NOT NULL DEFAULT 0,
  state text NOT NULL,
  program text, tool text,
  reason text,                         -- of no_data
  PRIMARY KEY (box_id, since, sequence, epoch)
) PARTITION BY RANGE (since);
CREATE INDEX state_list_since ON state_list USING brin (since);
CREATE TABLE part_list (
  sequence bigint NOT NULL,
  began timestamptz NOT NULL,
  ended timestamptz NOT NULL,
  box_id int NOT NULL,
  epoch bigint NOT NULL DEFAULT 0,
  part text, program text,
  count bigint NOT NULL,
  cutting_s float8, energy_j float8,
  detail jsonb,
  PRIMARY KEY (box_id, ended, sequence, epoch)
) PARTITION BY RANGE (ended);
CREATE INDEX part_list_ended ON part_list USING brin (ended);
CREATE TABLE operation_list (
  sequence bigint NOT NULL,            -- that of the part
  ended timestamptz NOT NULL,          -- of the part
  box_id int NOT NULL,
  epoch bigint NOT NULL DEFAULT 0,
  place int NOT NULL,                  -- 1, 2, ... within the part
  operation text, program text, part text,
  seconds float8, cutting_s float8, energy_j float8, mean_power_w float8,
  PRIMARY KEY (box_id, ended, sequence, place, epoch)
) PARTITION BY RANGE (ended);
CREATE INDEX operation_list_ended ON operation_list USING brin (ended);
-- An alarm is raised and cleared by two items, which may come in any order.
CREATE TABLE alarm_marks (
  box_id int NOT NULL, source text NOT NULL, code text NOT NULL, at timestamptz NOT NULL, raised boolean NOT NULL,
  sequence bigint NOT NULL, epoch bigint NOT NULL DEFAULT 0,
  severity text, en text, zh text,
  PRIMARY KEY (box_id, source, code, at, raised)
);
CREATE INDEX alarm_marks_at ON alarm_marks (at);
CREATE TABLE gap_list (
  box_id int NOT NULL, since timestamptz NOT NULL, until timestamptz, reason text NOT NULL, sequence bigint NOT NULL,
  epoch bigint NOT NULL DEFAULT 0,
  PRIMARY KEY (box_id, since)
);
CREATE TABLE event_list (
  box_id int NOT NULL, at timestamptz NOT NULL, sequence bigint NOT NULL, epoch bigint NOT NULL DEFAULT 0,
  kind text, source text, text text, detail jsonb,
  PRIMARY KEY (box_id, at, sequence, epoch)
);
CREATE INDEX event_list_at ON event_list USING brin (at);
CREATE TABLE decision_list (
  box_id int NOT NULL, at timestamptz NOT NULL, sequence bigint NOT NULL, epoch bigint NOT NULL DEFAULT 0, decision jsonb NOT NULL,
  PRIMARY KEY (box_id, at, sequence, epoch)
);
CREATE TABLE diagnosis_list (
  box_id int NOT NULL, at timestamptz NOT NULL, sequence bigint NOT NULL, epoch bigint NOT NULL DEFAULT 0,
  verdict text, summary text, diagnosis jsonb,
  PRIMARY KEY (box_id, at, sequence, epoch)
);
-- What only the shop knows: its shifts, and how long a cycle should take. Change the rows as they are here.
CREATE TABLE shifts (
  shift text PRIMARY KEY,
  starts time NOT NULL,
  ends time NOT NULL,                  -- not after `starts`: on the next day
  zone text NOT NULL
);
INSERT INTO shifts VALUES ('early', '06:00', '14:00', 'UTC'), ('late', '14:00', '22:00', 'UTC'), ('night', '22:00', '06:00', 'UTC');
CREATE TABLE cycle_targets (
  program text PRIMARY KEY,
  seconds float8 NOT NULL              -- for one part; where a program is missing, the fastest tenth of its cycles counts
);
