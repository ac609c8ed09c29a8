-- After the partitions of the new times are there: see redate.sql.
DELETE FROM part_list USING moving WHERE part_list.box_id = moving.box_id AND ended = at AND part_list.sequence = moving.sequence AND part_list.epoch = moving.epoch;
DELETE FROM operation_list USING moving
WHERE operation_list.box_id = moving.box_id AND ended = at AND operation_list.sequence = moving.sequence AND operation_list.epoch = moving.epoch;
DELETE FROM alarm_marks USING moving
WHERE alarm_marks.box_id = moving.box_id AND alarm_marks.at = moving.at AND alarm_marks.sequence = moving.sequence AND alarm_marks.epoch = moving.epoch;
DELETE FROM event_list USING moving
WHERE event_list.box_id = moving.box_id AND event_list.at = moving.at AND event_list.sequence = moving.sequence AND event_list.epoch = moving.epoch;
DELETE FROM decision_list USING moving
WHERE decision_list.box_id = moving.box_id AND decision_list.at = moving.at AND decision_list.sequence = moving.sequence AND decision_list.epoch = moving.epoch;
DELETE FROM diagnosis_list USING moving
WHERE diagnosis_list.box_id = moving.box_id AND diagnosis_list.at = moving.at AND diagnosis_list.sequence = moving.sequence AND diagnosis_list.epoch = moving.epoch;
DELETE FROM gap_list USING moving
WHERE gap_list.box_id = moving.box_id AND since = at AND gap_list.sequence = moving.sequence AND gap_list.epoch = moving.epoch;
DELETE FROM state_list USING moving
WHERE state_list.box_id = moving.box_id AND since IN (at, fleet_time((record ->> 'until_ns')::bigint))
  AND state_list.sequence = moving.sequence AND state_list.epoch = moving.epoch;
-- The places of means that are of other minutes.
CREATE TEMP TABLE emptied ON COMMIT DROP AS
SELECT box_id, kind, date_trunc(CASE kind WHEN 'minute' THEN 'hour' WHEN 'hour' THEN 'day' ELSE 'month' END, at) AS start,
       array_agg(DISTINCT CASE kind WHEN 'minute' THEN extract(minute FROM at) + 1 WHEN 'hour' THEN extract(hour FROM at) + 1 ELSE extract(day FROM at) END::int) AS places
FROM moving WHERE kind IN ('minute', 'hour', 'day') GROUP BY 1, 2, 3;
UPDATE minute_means AS old SET mean = fleet_emptied(mean, places), least = fleet_emptied(least, places), greatest = fleet_emptied(greatest, places),
  seconds = fleet_emptied(seconds, places)
FROM emptied CROSS JOIN series WHERE kind = 'minute' AND old.series_id = series.series_id AND old.box_id = emptied.box_id AND hour = start;
UPDATE hour_means AS old SET mean = fleet_emptied(mean, places), least = fleet_emptied(least, places), greatest = fleet_emptied(greatest, places),
  seconds = fleet_emptied(seconds, places)
FROM emptied CROSS JOIN series WHERE kind = 'hour' AND old.series_id = series.series_id AND old.box_id = emptied.box_id AND day = start;
UPDATE day_means AS old SET mean = fleet_emptied(mean, places), least = fleet_emptied(least, places), greatest = fleet_emptied(greatest, places),
  seconds = fleet_emptied(seconds, places)
FROM emptied CROSS JOIN series WHERE kind = 'day' AND old.series_id = series.series_id AND old.box_id = emptied.box_id AND month = start;
-- The newest values keep their values and get their times.
UPDATE box_latest SET cells = (
  SELECT coalesce(jsonb_object_agg(key, CASE WHEN by_ns IS NULL THEN value ELSE jsonb_set(value, '{0}', to_jsonb(((value ->> 0)::bigint * 1000 + by_ns) / 1000)) END), '{}')
  FROM jsonb_each(cells)
  LEFT JOIN LATERAL (
    SELECT by_ns FROM moving WHERE moving.box_id = box_latest.box_id AND kind = 'sample' AND at = fleet_time((value ->> 0)::bigint * 1000) LIMIT 1
  ) AS moved ON true)
WHERE box_id IN (SELECT box_id FROM moving);
UPDATE items SET at = new_at, at_ns = at_ns + CASE WHEN stays THEN 0 ELSE by_ns END, redated_ns = total, record = fleet_shifted(items.record, by_ns)
FROM moving WHERE (items.box_id, items.at, items.sequence, items.epoch) = (moving.box_id, moving.at, moving.sequence, moving.epoch);
DELETE FROM incoming;
INSERT INTO incoming (box_id, epoch, sequence, at, kind, record)
SELECT box_id, epoch, sequence, new_at, kind, fleet_shifted(record, by_ns) FROM moving
WHERE record IS NOT NULL AND NOT (kind = 'gap' AND coalesce(fleet_time((fleet_shifted(record, by_ns) ->> 'until_ns')::bigint) <= new_at, false));
-- What was heard last, and values that were older than those of the wrong time.
UPDATE box_latest SET last_at = newest.last_at, cells = coalesce(fleet_cells(box_latest.cells, coalesce(newest.cells, '{}')), '{}')
FROM (
  SELECT box_id, max(at) AS last_at, (
    SELECT jsonb_object_agg(series_id, CASE WHEN reason IS NULL THEN jsonb_build_array(at_us, value) ELSE jsonb_build_array(at_us, value, reason) END)
    FROM (
      SELECT DISTINCT ON (cell.series_id) cell.series_id, (at_ns - (at_ns % 1000 + 1000) % 1000) / 1000 AS at_us,
             coalesce(to_jsonb(numbers[place]), to_jsonb(texts[place - cardinality(numbers)])) AS value,
             reasons[place - cardinality(numbers) - cardinality(texts)] AS reason
      FROM items AS sample CROSS JOIN LATERAL unnest(series) WITH ORDINALITY AS cell (series_id, place)
      WHERE sample.box_id = moved.box_id AND kind = 'sample' AND at > (SELECT max(at) FROM items AS any_item WHERE any_item.box_id = moved.box_id AND any_item.kind = 'sample') - interval '1 hour'
      ORDER BY cell.series_id, at_ns DESC
    ) AS each) AS cells
  FROM (SELECT DISTINCT box_id FROM moving) AS moved JOIN items USING (box_id)
  WHERE kind NOT IN ('gap', 'minute', 'hour', 'day')
  GROUP BY box_id
) AS newest WHERE box_latest.box_id = newest.box_id;
