-- After the partitions of the new times are there: see redate.sql.
-- What was made of the items at their old times goes; it is made anew of the moved ones. A gap has made a row at its end, too.
DO $$ DECLARE made record; BEGIN
  FOR made IN SELECT * FROM (VALUES ('part_list', 'ended'), ('operation_list', 'ended'), ('alarm_marks', 'at'), ('event_list', 'at'), ('decision_list', 'at'),
    ('diagnosis_list', 'at'), ('gap_list', 'since'), ('state_list', 'since')) AS every (name, time_column)
  LOOP
    EXECUTE format('DELETE FROM %1$I AS old USING moving WHERE old.box_id = moving.box_id AND old.sequence = moving.sequence AND old.epoch = moving.epoch
      AND old.%2$I IN (moving.at, fleet_time((moving.record ->> ''until_ns'')::bigint))', made.name, made.time_column);
  END LOOP;
END $$;
-- The places of means that are of other minutes.
CREATE TEMP TABLE emptied ON COMMIT DROP AS
SELECT box_id, kind, date_trunc(CASE kind WHEN 'minute' THEN 'hour' WHEN 'hour' THEN 'day' ELSE 'month' END, at) AS start,
       array_agg(DISTINCT CASE kind WHEN 'minute' THEN extract(minute FROM at) + 1 WHEN 'hour' THEN extract(hour FROM at) + 1 ELSE extract(day FROM at) END::int) AS places
FROM moving WHERE kind IN ('minute', 'hour', 'day') GROUP BY 1, 2, 3;
DO $$ DECLARE means record; BEGIN
  FOR means IN SELECT * FROM (VALUES ('minute', 'hour'), ('hour', 'day'), ('day', 'month')) AS every (kind, time_column)
  LOOP
    EXECUTE format('UPDATE %1$I AS old SET mean = fleet_emptied(mean, places), least = fleet_emptied(least, places), greatest = fleet_emptied(greatest, places),
        seconds = fleet_emptied(seconds, places)
      FROM emptied CROSS JOIN series
      WHERE kind = %2$L AND old.series_id = series.series_id AND old.box_id = emptied.box_id AND old.%3$I = start', means.kind || '_means', means.kind, means.time_column);
  END LOOP;
END $$;
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
