-- A small plant whose truth is known: two lathes of one name and a mill, the night in which the clocks of Berlin go back.
CREATE TABLE state_list_2026_10 PARTITION OF state_list FOR VALUES FROM ('2026-10-01 00:00:00+00') TO ('2026-11-01 00:00:00+00');
CREATE TABLE part_list_2026_10 PARTITION OF part_list FOR VALUES FROM ('2026-10-01 00:00:00+00') TO ('2026-11-01 00:00:00+00');
INSERT INTO boxes (box, machine, named_at) VALUES ('A', 'Lathe 7', '2026-10-01'), ('B', 'Lathe 7', '2026-10-01'), ('C', 'Mill 2', '2026-10-01');
INSERT INTO box_latest SELECT box_id, '2026-10-25 23:00:00+00', now(), 1, '{}' FROM boxes;
DELETE FROM shifts;
INSERT INTO shifts VALUES ('night', '22:00', '06:00', 'Europe/Berlin'), ('early', '06:00', '14:00', 'Asia/Shanghai'), ('late', '14:00', '22:00', 'UTC');
INSERT INTO cycle_targets VALUES ('O1', 9000);
-- A cuts for six of the nine hours of the night and stands by for three, two hours of them between its parts.
INSERT INTO state_list (box_id, sequence, since, until, state) VALUES
  (1, 1, '2026-10-24 20:00:00+00', '2026-10-24 23:00:00+00', 'cutting'),
  (1, 2, '2026-10-24 23:00:00+00', '2026-10-25 01:00:00+00', 'standby'),
  (1, 3, '2026-10-25 01:00:00+00', '2026-10-25 04:00:00+00', 'cutting'),
  (1, 4, '2026-10-25 04:00:00+00', '2026-10-25 05:00:00+00', 'standby'),
  (1, 5, '2026-10-25 05:00:00+00', NULL, 'no_data'),
  -- B is at work the whole night and makes no part.
  (2, 1, '2026-10-24 20:00:00+00', '2026-10-25 05:00:00+00', 'idle'),
  (2, 2, '2026-10-25 05:00:00+00', NULL, 'no_data'),
  -- C has been at work since the early shift of Shanghai began, and is still.
  (3, 1, '2026-10-25 22:00:00+00', NULL, 'cutting');
-- The second cycle of A begins with the standby before it.
INSERT INTO part_list (box_id, sequence, began, ended, program, count, energy_j, detail) VALUES
  (1, 1, '2026-10-24 20:00:00+00', '2026-10-24 23:00:00+00', 'O1', 1, 3.6e6, '{"seconds": {"cutting": 10800.0}}'),
  (1, 2, '2026-10-24 23:00:00+00', '2026-10-25 04:00:00+00', 'O1', 1, 3.6e6, '{"seconds": {"cutting": 10800.0, "standby": 7200.0}}'),
  -- C has made two parts of a program without a target in half an hour each, and the box has not told their states.
  (3, 1, '2026-10-25 22:00:00+00', '2026-10-25 22:30:00+00', 'O2', 1, NULL, NULL),
  (3, 2, '2026-10-25 22:30:00+00', '2026-10-25 23:00:00+00', 'O2', 1, NULL, NULL);
CREATE TABLE items_2026_10_24 PARTITION OF items FOR VALUES FROM ('2026-10-24 00:00:00+00') TO ('2026-10-26 00:00:00+00');
CREATE TABLE hour_means_2026 PARTITION OF hour_means FOR VALUES FROM ('2026-01-01 00:00:00+00') TO ('2027-01-01 00:00:00+00');
CREATE TABLE operation_list_2026_10 PARTITION OF operation_list FOR VALUES FROM ('2026-10-01 00:00:00+00') TO ('2026-11-01 00:00:00+00');
INSERT INTO series (name, unit) VALUES ('spindle_power_w', 'W'), ('total_power_w', 'W'), ('feed_mm_min', 'mm/min');
-- B draws 200 W from half past four in the afternoon until the gap at eight; an item between says nothing of its power. C draws 500 W from a
-- minute before it cuts, and 1500 W in the second half hour.
INSERT INTO items (box_id, sequence, at, at_ns, arrived, historical, kind, series, numbers, texts, reasons)
SELECT box_id, sequence, at::timestamptz, (extract(epoch FROM at::timestamptz) * 1000000000)::bigint, at::timestamptz, false, kind, CASE WHEN number IS NOT NULL THEN ARRAY[series_id] END, CASE WHEN number IS NOT NULL THEN ARRAY[number::float8] END, '{}', '{}'
FROM (VALUES (2, 10, '2026-10-25 16:30:00+00', 'sample', 'spindle_power_w', 200), (2, 11, '2026-10-25 17:30:00+00', 'sample', 'feed_mm_min', 900),
  (2, 12, '2026-10-25 20:00:00+00', 'gap', NULL, NULL), (3, 10, '2026-10-25 21:59:00+00', 'sample', 'spindle_power_w', 500),
  (3, 11, '2026-10-25 22:10:00+00', 'sample', 'feed_mm_min', 900), (3, 12, '2026-10-25 22:30:00+00', 'sample', 'spindle_power_w', 1500))
  AS told (box_id, sequence, at, kind, name, number)
LEFT JOIN series USING (name);
-- Means of hours: A has a meter of the whole machine on the second day only, B has none.
INSERT INTO hour_means (series_id, box_id, day, mean, least, greatest, seconds)
SELECT series_id, box_id, day::timestamptz, list.watts, list.watts, list.watts, list.seconds
FROM (VALUES (1, 'spindle_power_w', '2026-10-24 00:00:00+00', 20, 20, 500), (1, 'spindle_power_w', '2026-10-25 00:00:00+00', 1, 2, 700),
  (1, 'total_power_w', '2026-10-25 00:00:00+00', 1, 2, 1000), (2, 'spindle_power_w', '2026-10-25 00:00:00+00', 17, 19, 200))
  AS told (box_id, name, day, low, high, watts)
JOIN series USING (name)
CROSS JOIN LATERAL (
  SELECT array_agg(CASE WHEN h BETWEEN low AND high THEN told.watts ELSE 0 END ORDER BY h)::real[] AS watts,
         array_agg(CASE WHEN h BETWEEN low AND high THEN 3600 ELSE 0 END ORDER BY h)::real[] AS seconds
  FROM generate_series(0, 23) AS h) AS list;
INSERT INTO operation_list (box_id, sequence, ended, place, operation, program, part, seconds, cutting_s, energy_j, mean_power_w) VALUES
  (1, 1, '2026-10-24 23:00:00+00', 1, 'rough', 'O1', '1', 7200, 7000, 2.4e6, 333), (1, 2, '2026-10-25 04:00:00+00', 1, 'rough', 'O1', '2', 3600, 3500, 1.2e6, 333);
-- An alarm of A stood for twenty minutes and was raised again meanwhile, one of B for ten.
INSERT INTO alarm_marks (box_id, source, code, at, raised, sequence, severity) VALUES
  (1, 'own.rhai', 'overload', '2026-10-24 21:00:00+00', true, 21, 'warning'), (1, 'own.rhai', 'overload', '2026-10-24 21:10:00+00', true, 22, 'warning'),
  (1, 'own.rhai', 'overload', '2026-10-24 21:20:00+00', false, 23, NULL), (2, 'own.rhai', 'overload', '2026-10-25 01:00:00+00', true, 21, 'warning'),
  (2, 'own.rhai', 'overload', '2026-10-25 01:10:00+00', false, 22, NULL);
INSERT INTO diagnosis_list (box_id, at, sequence, verdict, diagnosis) VALUES
  (1, '2026-10-25 02:00:00+00', 31, 'explained', '{"missing": [{"effect": "bearing_friction"}]}'),
  (3, '2026-10-25 22:40:00+00', 31, 'explained', '{"missing": [{"effect": "bearing_friction"}, {"effect": "coolant_drag"}]}');
