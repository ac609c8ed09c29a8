-- What the plant of shifts.sql has told of lathe A: two plans that overlap (22:00 to 03:00), one scrap part of three that were told and one that was
-- taken back, two orders, and why it stood.
INSERT INTO fact_list (box_id, since, until, fact, value, parts, mark, way, at, sequence) VALUES
  (1, '2026-10-24 22:00:00+00', '2026-10-25 02:00:00+00', 'planned_time', '', NULL, 'p1', 'csv', '2026-10-20', 1),
  (1, '2026-10-25 01:00:00+00', '2026-10-25 03:00:00+00', 'planned_time', '', NULL, 'p2', 'csv', '2026-10-20', 2),
  (1, '2026-10-25 03:30:00+00', NULL, 'scrap', 'chatter', 2, 's1', 'http', '2026-10-25', 3),
  (1, '2026-10-25 03:50:00+00', NULL, 'scrap', 'counted twice', -1, 's2', 'http', '2026-10-25', 4),
  (1, '2026-10-24 19:00:00+00', NULL, 'order', 'A-1', 10, 'o1', 'plant', '2026-10-24', 5),
  (1, '2026-10-24 23:30:00+00', NULL, 'order', 'A-2', NULL, 'o2', 'plant', '2026-10-24', 6),
  (1, '2026-10-25 04:30:00+00', NULL, 'order', '', NULL, 'o3', 'plant', '2026-10-25', 7),
  (1, '2026-10-24 23:00:00+00', '2026-10-25 01:00:00+00', 'stop_reason', 'setup', NULL, 'r1', 'page', '2026-10-25', 8);
