-- Version 3. What `cnc-gateway fleet ingest` creates. Times are those of the machines; `arrived` is when the stream had the item.
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
  kind text NOT NULL,                  -- sample, state, part, alarm, alarm_clear, decision, diagnosis, event, gap, minute, hour, day
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
-- Items that a box had sent with the time of a clock that was wrong: those of an epoch with these numbers are so much later.
CREATE TABLE clock_moves (
  box_id int NOT NULL REFERENCES boxes ON DELETE CASCADE,
  told_epoch bigint NOT NULL, told_sequence bigint NOT NULL, place int NOT NULL, -- of the event that tells it
  epoch bigint NOT NULL, from_sequence bigint NOT NULL, to_sequence bigint NOT NULL,
  by_ns bigint NOT NULL,
  from_at timestamptz, to_at timestamptz,  -- times of the samples before
  PRIMARY KEY (box_id, told_epoch, told_sequence, place)
);
-- Functions and views; made anew by every version of `cnc-gateway fleet ingest`.
CREATE OR REPLACE FUNCTION fleet_time(ns bigint) RETURNS timestamptz LANGUAGE sql IMMUTABLE PARALLEL SAFE AS
  $$SELECT timestamptz 'epoch' + div(ns, 1000) * interval '1 microsecond'$$;
-- Of two lists of cells the newer of each.
CREATE OR REPLACE FUNCTION fleet_cells(a jsonb, b jsonb) RETURNS jsonb LANGUAGE sql IMMUTABLE PARALLEL SAFE AS
  $$SELECT jsonb_object_agg(key, value) FROM (
      SELECT DISTINCT ON (key) key, value FROM (SELECT * FROM jsonb_each(a) UNION ALL SELECT * FROM jsonb_each(b)) AS every
      ORDER BY key, (value ->> 0)::bigint DESC) AS newest$$;

-- These places of a list have no value.
CREATE OR REPLACE FUNCTION fleet_emptied(list real[], places int[]) RETURNS real[] LANGUAGE sql IMMUTABLE PARALLEL SAFE AS
  $$SELECT array_agg(CASE WHEN place = ANY (places) THEN NULL ELSE one END ORDER BY place) FROM unnest(list) WITH ORDINALITY AS each (one, place)$$;
-- A record whose times are so much later.
CREATE OR REPLACE FUNCTION fleet_shifted(record jsonb, by_ns bigint) RETURNS jsonb LANGUAGE sql IMMUTABLE PARALLEL SAFE AS
  $$SELECT record || coalesce((SELECT jsonb_object_agg(key, value::text::bigint + by_ns) FROM jsonb_each(CASE jsonb_typeof(record) WHEN 'object' THEN record ELSE '{}' END)
      WHERE key IN ('at_ns', 'began_ns', 'ended_ns', 'from_ns', 'to_ns', 'until_ns') AND jsonb_typeof(value) = 'number'), '{}')$$;
-- The stretches of a box's states from `low` to `high` end where the next one begins.
CREATE OR REPLACE FUNCTION fleet_join_states(box int, low timestamptz, high timestamptz) RETURNS void LANGUAGE sql AS $$
  UPDATE state_list AS changed SET until = found.until
  FROM (
    SELECT box_id, since, sequence, epoch, lead(since) OVER (ORDER BY since, epoch, sequence) AS until
    FROM (
      (SELECT box_id, since, sequence, epoch FROM state_list WHERE box_id = box AND since < low ORDER BY since DESC, epoch DESC, sequence DESC LIMIT 1)
      UNION ALL
      (SELECT box_id, since, sequence, epoch FROM state_list WHERE box_id = box AND since >= low AND since <= high)
      UNION ALL
      (SELECT box_id, since, sequence, epoch FROM state_list WHERE box_id = box AND since > high ORDER BY since, epoch, sequence LIMIT 1)
    ) AS near
  ) AS found
  WHERE changed.box_id = found.box_id AND changed.since = found.since AND changed.sequence = found.sequence AND changed.epoch = found.epoch
    AND (found.until IS NOT NULL OR found.since <= high) AND changed.until IS DISTINCT FROM found.until$$;

-- What each box is called: its machine, and where two boxes have one of the same name, the box as well.
CREATE OR REPLACE VIEW labels AS
  SELECT box_id, CASE count(*) OVER (PARTITION BY machine) WHEN 1 THEN machine ELSE machine || ' (' || box || ')' END AS label FROM boxes;
-- Is the spindle or an axis at work in this state?
CREATE OR REPLACE FUNCTION fleet_is_at_work(state text) RETURNS boolean LANGUAGE sql IMMUTABLE PARALLEL SAFE AS
  $$SELECT state IN ('spindle_start', 'idle', 'cutting', 'rapid', 'speed_change')$$;

-- A box that has gone is a row, too: `connected` says whether something has come within three minutes (a box sends at least once a
-- minute).
CREATE OR REPLACE VIEW last_seen AS
  SELECT machine, box, first_seen, last_at, last_arrival, now() - last_arrival AS silent,
         now() - last_arrival < interval '3 minutes' AS connected, last_sequence, box_id
  FROM boxes LEFT JOIN box_latest USING (box_id);

-- The newest value of every series; `missing_reason` where there is none.
CREATE OR REPLACE VIEW latest AS
  SELECT boxes.machine, boxes.box, series.name, series.unit, fleet_time((cell.value ->> 0)::bigint * 1000) AS at,
         CASE jsonb_typeof(cell.value -> 1) WHEN 'number' THEN (cell.value ->> 1)::float8 END AS number,
         CASE jsonb_typeof(cell.value -> 1) WHEN 'string' THEN cell.value ->> 1 END AS text,
         cell.value ->> 2 AS missing_reason, now() - box_latest.last_arrival < interval '3 minutes' AS connected
  FROM box_latest
  JOIN boxes USING (box_id)
  CROSS JOIN LATERAL jsonb_each(box_latest.cells) AS cell
  JOIN series ON series.series_id = cell.key::int;

-- What every machine is doing now: a row for each. A box that nobody hears has no state, whatever it said last.
CREATE OR REPLACE VIEW machines_now AS
  SELECT machine, box, connected,
         CASE WHEN connected THEN newest.state ELSE 'no_data' END AS state,
         CASE WHEN connected THEN newest.since ELSE last_at END AS since,
         newest.program, newest.tool, newest.state AS last_state, last_at, last_arrival, box_id
  FROM last_seen
  LEFT JOIN LATERAL (
    SELECT state, since, program, tool FROM state_list WHERE state_list.box_id = last_seen.box_id ORDER BY since DESC, epoch DESC, sequence DESC LIMIT 1
  ) AS newest ON true;

-- Every value with the time for which it held: until the next one of its series, a gap, or what was heard last of the box. Conditions on
-- box, name and `valid_from` are fast. Means: sum(number * seconds) / sum(seconds), where number is not null.
CREATE OR REPLACE VIEW readings AS
  SELECT boxes.machine, boxes.box, series.name, series.unit, items.at AS valid_from, held.until AS valid_to,
         items.numbers[cell.place] AS number, items.texts[cell.place - cardinality(items.numbers)] AS text,
         items.reasons[cell.place - cardinality(items.numbers) - cardinality(items.texts)] AS missing_reason,
         extract(epoch FROM held.until - items.at)::float8 AS seconds,
         items.sequence, items.at_ns, items.arrived, items.historical, items.box_id
  FROM items
  CROSS JOIN LATERAL unnest(items.series) WITH ORDINALITY AS cell (series_id, place)
  JOIN series ON series.series_id = cell.series_id
  JOIN boxes ON boxes.box_id = items.box_id
  CROSS JOIN LATERAL (
    SELECT coalesce(
      (SELECT next.at FROM items AS next
       WHERE next.box_id = items.box_id AND next.at > items.at AND next.at < items.at + interval '1 day'
         AND (next.series @> ARRAY[cell.series_id] OR next.kind = 'gap')
       ORDER BY next.at LIMIT 1),
      (SELECT least(last_at, items.at + interval '1 day') FROM box_latest WHERE box_latest.box_id = items.box_id)) AS until
  ) AS held
  WHERE items.kind = 'sample';

-- Means of minutes, hours and days. Conditions on name and on `hour`, `day`, `month` are fast; `at` is the beginning of the minute, hour, day.
CREATE OR REPLACE VIEW minutes AS
  SELECT boxes.machine, boxes.box, series.name, series.unit, hour, hour + (place - 1) * interval '1 minute' AS at,
         each.mean, each.least, each.greatest, each.seconds, minute_means.box_id
  FROM minute_means JOIN series USING (series_id) JOIN boxes USING (box_id)
  CROSS JOIN LATERAL unnest(minute_means.mean, minute_means.least, minute_means.greatest, minute_means.seconds)
    WITH ORDINALITY AS each (mean, least, greatest, seconds, place)
  WHERE each.seconds > 0;
CREATE OR REPLACE VIEW hours AS
  SELECT boxes.machine, boxes.box, series.name, series.unit, day, day + (place - 1) * interval '1 hour' AS at,
         each.mean, each.least, each.greatest, each.seconds, hour_means.box_id
  FROM hour_means JOIN series USING (series_id) JOIN boxes USING (box_id)
  CROSS JOIN LATERAL unnest(hour_means.mean, hour_means.least, hour_means.greatest, hour_means.seconds)
    WITH ORDINALITY AS each (mean, least, greatest, seconds, place)
  WHERE each.seconds > 0;
CREATE OR REPLACE VIEW days AS
  SELECT boxes.machine, boxes.box, series.name, series.unit, month, month + (place - 1) * interval '1 day' AS at,
         each.mean, each.least, each.greatest, each.seconds, day_means.box_id
  FROM day_means JOIN series USING (series_id) JOIN boxes USING (box_id)
  CROSS JOIN LATERAL unnest(day_means.mean, day_means.least, day_means.greatest, day_means.seconds)
    WITH ORDINALITY AS each (mean, least, greatest, seconds, place)
  WHERE each.seconds > 0;

-- Energy of each machine and day (UTC), all of it, also between parts: from the power of the whole machine on days that have one, else from
-- that of the spindle. The running hour comes from its minutes. Conditions on `day` are fast.
CREATE OR REPLACE VIEW energy_by_day AS
  SELECT machine, box_id, day, sum(joule) / 3.6e6 AS kwh
  FROM (
    SELECT machine, box_id, day, name, joule, bool_or(name = 'total_power_w') OVER (PARTITION BY box_id, day) AS whole
    FROM (
      SELECT machine, box_id, day, name, mean * seconds AS joule FROM hours
      WHERE name IN ('total_power_w', 'spindle_power_w') AND at < date_trunc('hour', now(), 'UTC')
      UNION ALL
      SELECT machine, box_id, date_trunc('day', hour, 'UTC'), name, mean * seconds FROM minutes
      WHERE name IN ('total_power_w', 'spindle_power_w') AND hour = date_trunc('hour', now(), 'UTC')
    ) AS power
  ) AS measured
  WHERE name = CASE WHEN whole THEN 'total_power_w' ELSE 'spindle_power_w' END
  GROUP BY machine, box_id, day;

-- The newest stretch of a machine that is connected has no end yet; of one that has gone it ends with what was heard last.
CREATE OR REPLACE VIEW states AS
  SELECT boxes.machine, boxes.box, since,
         CASE WHEN until IS NULL AND NOT last_seen.connected THEN greatest(since, last_at) ELSE until END AS until,
         state, program, tool, reason, sequence, box_id
  FROM state_list JOIN boxes USING (box_id) JOIN last_seen USING (box_id);
CREATE OR REPLACE VIEW parts AS
  SELECT boxes.machine, boxes.box, began, ended, part, program, count, extract(epoch FROM ended - began)::float8 AS seconds,
         cutting_s, energy_j, detail, sequence, box_id
  FROM part_list JOIN boxes USING (box_id);
CREATE OR REPLACE VIEW operations AS
  SELECT boxes.machine, boxes.box, ended, program, part, operation, place, seconds, cutting_s, energy_j, mean_power_w, sequence, box_id
  FROM operation_list JOIN boxes USING (box_id);
-- An alarm that was raised again while it stood is one alarm.
CREATE OR REPLACE VIEW alarms AS
  SELECT boxes.machine, boxes.box, mark.code, mark.source, mark.severity, mark.at AS raised, cleared.at AS cleared, mark.en, mark.zh, mark.sequence, box_id
  FROM alarm_marks AS mark JOIN boxes USING (box_id)
  LEFT JOIN LATERAL (
    SELECT raised FROM alarm_marks AS before
    WHERE (before.box_id, before.source, before.code) = (mark.box_id, mark.source, mark.code) AND before.at < mark.at
    ORDER BY before.at DESC, before.raised LIMIT 1
  ) AS before ON true
  LEFT JOIN LATERAL (
    SELECT at FROM alarm_marks AS after
    WHERE (after.box_id, after.source, after.code) = (mark.box_id, mark.source, mark.code) AND after.at >= mark.at AND NOT after.raised
    ORDER BY after.at LIMIT 1
  ) AS cleared ON true
  WHERE mark.raised AND before.raised IS DISTINCT FROM true;
CREATE OR REPLACE VIEW gaps AS
  SELECT boxes.machine, boxes.box, since, until, reason, box_id FROM gap_list JOIN boxes USING (box_id);
CREATE OR REPLACE VIEW events AS
  SELECT boxes.machine, boxes.box, at, kind, source, text, detail, sequence, box_id FROM event_list JOIN boxes USING (box_id);
CREATE OR REPLACE VIEW decisions AS
  SELECT boxes.machine, boxes.box, at, decision ->> 'script' AS script, decision ->> 'wanted' AS wanted, (decision ->> 'value')::float8 AS value,
         decision ->> 'unit' AS unit, decision ->> 'reason' AS reason, decision ->> 'outcome' AS outcome,
         decision ->> 'outcome_reason' AS outcome_reason, sequence, box_id
  FROM decision_list JOIN boxes USING (box_id);
CREATE OR REPLACE VIEW diagnoses AS
  SELECT boxes.machine, boxes.box, at, verdict, summary, diagnosis, sequence, box_id FROM diagnosis_list JOIN boxes USING (box_id);

INSERT INTO fleet_schema (version) VALUES (3);
CREATE TABLE items_2026_01_30 PARTITION OF items FOR VALUES FROM ('2026-01-30 00:00:00+00') TO ('2026-01-31 00:00:00+00');
CREATE TABLE state_list_2026_01 PARTITION OF state_list FOR VALUES FROM ('2026-01-01 00:00:00+00') TO ('2026-02-01 00:00:00+00');
INSERT INTO boxes (box, machine, named_at) VALUES ('Lathe-8-3fa9c1', 'Lathe 8', '2026-01-30 10:00:00+00');
INSERT INTO series (name, unit) VALUES ('spindle_power_w', 'W');
INSERT INTO items (sequence, at, at_ns, arrived, box_id, historical, kind, series, numbers, texts, reasons)
VALUES (7, '2026-01-30 10:00:00+00', 1769767200000000000, '2026-01-30 10:00:01+00', 1, false, 'sample', '{1}', '{100.5}', '{}', '{}');
INSERT INTO state_list (sequence, since, box_id, state, program) VALUES (6, '2026-01-30 10:00:00+00', 1, 'cutting', 'O1');
INSERT INTO box_latest VALUES (1, '2026-01-30 10:00:00+00', '2026-01-30 10:00:01+00', 7, '{}');
