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

-- What each box is called: the path of the machine at which it stands; without a path its machine, and where two boxes have one of the
-- same name, the box as well.
CREATE OR REPLACE VIEW labels AS
  SELECT box_id, coalesce(path, CASE count(*) OVER (PARTITION BY boxes.machine, path) WHEN 1 THEN boxes.machine ELSE boxes.machine || ' (' || box || ')' END) AS label
  FROM boxes LEFT JOIN LATERAL (
    SELECT path FROM box_machines LEFT JOIN machines USING (machine_id) WHERE box_machines.box_id = boxes.box_id ORDER BY since DESC LIMIT 1
  ) AS place ON true;
-- At which machine each box stood, and when: a row for each stay, from -infinity to infinity where there is one only. What a box has
-- recorded before its first path is of that machine, too. Join by box and time, and group by `label`: a machine is one whatever box stood there.
CREATE OR REPLACE VIEW placements AS
  SELECT stay.box_id, stay.machine_id, path, coalesce(path, label) AS label, stay.since, stay.until
  FROM (
    SELECT boxes.box_id, machine_id,
           CASE row_number() OVER stays WHEN 1 THEN '-infinity' ELSE box_machines.since END AS since,
           coalesce(lead(box_machines.since) OVER stays, 'infinity') AS until
    FROM boxes LEFT JOIN box_machines USING (box_id) WINDOW stays AS (PARTITION BY boxes.box_id ORDER BY box_machines.since)
  ) AS stay
  JOIN labels USING (box_id) LEFT JOIN machines USING (machine_id);
-- The path of the machine at which a box stood at a time; empty where it had none.
CREATE OR REPLACE FUNCTION fleet_path(box int, moment timestamptz) RETURNS text LANGUAGE sql STABLE PARALLEL SAFE AS
  $$SELECT path FROM placements WHERE box_id = box AND since <= moment AND until > moment$$;
-- Is the spindle or an axis at work in this state?
CREATE OR REPLACE FUNCTION fleet_is_at_work(state text) RETURNS boolean LANGUAGE sql IMMUTABLE PARALLEL SAFE AS
  $$SELECT state IN ('spindle_start', 'idle', 'cutting', 'rapid', 'speed_change')$$;

-- A box that has gone is a row, too: `connected` says whether something has come within three minutes (a box sends at least once a
-- minute).
CREATE OR REPLACE VIEW last_seen AS
  SELECT machine, box, first_seen, last_at, last_arrival, now() - last_arrival AS silent,
         now() - last_arrival < interval '3 minutes' AS connected, last_sequence, box_id, fleet_path(box_id, last_at) AS path
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

-- What every machine is doing now: a row for each, of the box that stands there now. A box that nobody hears has no state, whatever it said
-- last.
CREATE OR REPLACE VIEW machines_now AS
  SELECT machine, box, connected,
         CASE WHEN connected THEN newest.state ELSE 'no_data' END AS state,
         CASE WHEN connected THEN newest.since ELSE last_at END AS since,
         newest.program, newest.tool, newest.state AS last_state, last_at, last_arrival, box_id, path
  FROM last_seen
  LEFT JOIN LATERAL (
    SELECT state, since, program, tool FROM state_list WHERE state_list.box_id = last_seen.box_id ORDER BY since DESC, epoch DESC, sequence DESC LIMIT 1
  ) AS newest ON true
  -- Another box has come to the machine since this one did.
  WHERE NOT EXISTS (
    SELECT FROM placements AS own JOIN box_machines AS later USING (machine_id)
    WHERE own.box_id = last_seen.box_id AND own.until = 'infinity' AND later.box_id <> own.box_id
      AND later.since > (SELECT max(since) FROM box_machines AS mine WHERE mine.box_id = own.box_id));

-- Every value with the time for which it held: until the next one of its series, a gap, or what was heard last of the box. Conditions on
-- box, name and `valid_from` are fast. Means: sum(number * seconds) / sum(seconds), where number is not null.
CREATE OR REPLACE VIEW readings AS
  SELECT boxes.machine, boxes.box, series.name, series.unit, items.at AS valid_from, held.until AS valid_to,
         items.numbers[cell.place] AS number, items.texts[cell.place - cardinality(items.numbers)] AS text,
         items.reasons[cell.place - cardinality(items.numbers) - cardinality(items.texts)] AS missing_reason,
         extract(epoch FROM held.until - items.at)::float8 AS seconds,
         items.sequence, items.at_ns, items.arrived, items.historical, items.box_id, fleet_path(items.box_id, items.at) AS path
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
         each.mean, each.least, each.greatest, each.seconds, minute_means.box_id, fleet_path(minute_means.box_id, hour) AS path
  FROM minute_means JOIN series USING (series_id) JOIN boxes USING (box_id)
  CROSS JOIN LATERAL unnest(minute_means.mean, minute_means.least, minute_means.greatest, minute_means.seconds)
    WITH ORDINALITY AS each (mean, least, greatest, seconds, place)
  WHERE each.seconds > 0;
CREATE OR REPLACE VIEW hours AS
  SELECT boxes.machine, boxes.box, series.name, series.unit, day, day + (place - 1) * interval '1 hour' AS at,
         each.mean, each.least, each.greatest, each.seconds, hour_means.box_id, fleet_path(hour_means.box_id, day + (place - 1) * interval '1 hour') AS path
  FROM hour_means JOIN series USING (series_id) JOIN boxes USING (box_id)
  CROSS JOIN LATERAL unnest(hour_means.mean, hour_means.least, hour_means.greatest, hour_means.seconds)
    WITH ORDINALITY AS each (mean, least, greatest, seconds, place)
  WHERE each.seconds > 0;
CREATE OR REPLACE VIEW days AS
  SELECT boxes.machine, boxes.box, series.name, series.unit, month, month + (place - 1) * interval '1 day' AS at,
         each.mean, each.least, each.greatest, each.seconds, day_means.box_id, fleet_path(day_means.box_id, month + (place - 1) * interval '1 day') AS path
  FROM day_means JOIN series USING (series_id) JOIN boxes USING (box_id)
  CROSS JOIN LATERAL unnest(day_means.mean, day_means.least, day_means.greatest, day_means.seconds)
    WITH ORDINALITY AS each (mean, least, greatest, seconds, place)
  WHERE each.seconds > 0;

-- Energy of each machine and day (UTC), all of it, also between parts: from the power of the whole machine on days that have one, else from
-- that of the spindle. The running hour comes from its minutes. Conditions on `day` are fast.
CREATE OR REPLACE VIEW energy_by_day AS
  SELECT machine, measured.box_id, day, sum(joule) / 3.6e6 AS kwh, path
  FROM (
    SELECT machine, box_id, day, at, name, joule, bool_or(name = 'total_power_w') OVER (PARTITION BY box_id, day) AS whole
    FROM (
      SELECT machine, box_id, day, at, name, mean * seconds AS joule FROM hours
      WHERE name IN ('total_power_w', 'spindle_power_w') AND at < date_trunc('hour', now(), 'UTC')
      UNION ALL
      SELECT machine, box_id, date_trunc('day', hour, 'UTC'), at, name, mean * seconds FROM minutes
      WHERE name IN ('total_power_w', 'spindle_power_w') AND hour = date_trunc('hour', now(), 'UTC')
    ) AS power
  ) AS measured
  JOIN placements ON placements.box_id = measured.box_id AND at >= since AND at < until
  WHERE name = CASE WHEN whole THEN 'total_power_w' ELSE 'spindle_power_w' END
  GROUP BY machine, measured.box_id, day, path;

-- The newest stretch of a machine that is connected has no end yet; of one that has gone it ends with what was heard last.
CREATE OR REPLACE VIEW states AS
  SELECT boxes.machine, boxes.box, since,
         CASE WHEN until IS NULL AND NOT last_seen.connected THEN greatest(since, last_at) ELSE until END AS until,
         state, program, tool, reason, sequence, box_id, fleet_path(box_id, since) AS path
  FROM state_list JOIN boxes USING (box_id) JOIN last_seen USING (box_id);
CREATE OR REPLACE VIEW parts AS
  SELECT boxes.machine, boxes.box, began, ended, part, program, count, extract(epoch FROM ended - began)::float8 AS seconds,
         cutting_s, energy_j, detail, sequence, box_id, fleet_path(box_id, ended) AS path
  FROM part_list JOIN boxes USING (box_id);
CREATE OR REPLACE VIEW operations AS
  SELECT boxes.machine, boxes.box, ended, program, part, operation, place, seconds, cutting_s, energy_j, mean_power_w, sequence, box_id, fleet_path(box_id, ended) AS path
  FROM operation_list JOIN boxes USING (box_id);
-- An alarm that was raised again while it stood is one alarm.
CREATE OR REPLACE VIEW alarms AS
  SELECT boxes.machine, boxes.box, mark.code, mark.source, mark.severity, mark.at AS raised, cleared.at AS cleared, mark.en, mark.zh, mark.sequence, box_id, fleet_path(box_id, mark.at) AS path
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
  SELECT boxes.machine, boxes.box, since, until, reason, box_id, fleet_path(box_id, since) AS path FROM gap_list JOIN boxes USING (box_id);
CREATE OR REPLACE VIEW events AS
  SELECT boxes.machine, boxes.box, at, kind, source, text, detail, sequence, box_id, fleet_path(box_id, at) AS path FROM event_list JOIN boxes USING (box_id);
CREATE OR REPLACE VIEW decisions AS
  SELECT boxes.machine, boxes.box, at, decision ->> 'script' AS script, decision ->> 'wanted' AS wanted, (decision ->> 'value')::float8 AS value,
         decision ->> 'unit' AS unit, decision ->> 'reason' AS reason, decision ->> 'outcome' AS outcome,
         decision ->> 'outcome_reason' AS outcome_reason, sequence, box_id, fleet_path(box_id, at) AS path
  FROM decision_list JOIN boxes USING (box_id);
CREATE OR REPLACE VIEW diagnoses AS
  SELECT boxes.machine, boxes.box, at, verdict, summary, diagnosis, sequence, box_id, fleet_path(box_id, at) AS path FROM diagnosis_list JOIN boxes USING (box_id);

-- What the plant has told. `order`, `operator` and `shift` hold until the next fact of their kind: `until` is then its beginning.
CREATE OR REPLACE VIEW facts AS
  SELECT boxes.machine, boxes.box, fact_list.since,
         CASE WHEN fact IN ('order', 'operator', 'shift') THEN lead(fact_list.since) OVER (PARTITION BY place.label, fact ORDER BY fact_list.since, fact_list.at) ELSE fact_list.until END AS until,
         fact, value, parts, mark, way, author, fact_list.at, sequence, fact_list.box_id, place.path, place.label
  FROM fact_list JOIN boxes USING (box_id)
  JOIN placements AS place ON place.box_id = fact_list.box_id AND fact_list.since >= place.since AND fact_list.since < place.until;
