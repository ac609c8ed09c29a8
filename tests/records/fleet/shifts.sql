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
