-- Beside the plant of shifts.sql what only panels show: A has means of two minutes and its wear, and is silent; a message of each of two days was refused.
INSERT INTO series (name, unit) VALUES ('tool_wear_mm', 'mm');
CREATE TABLE minute_means_2026_10 PARTITION OF minute_means FOR VALUES FROM ('2026-10-01 00:00:00+00') TO ('2026-11-01 00:00:00+00');
INSERT INTO minute_means (series_id, box_id, hour, mean, least, greatest, seconds)
SELECT series_id, 1, '2026-10-25 01:00:00+00', ARRAY[400, 600]::real[], ARRAY[300, 500]::real[], ARRAY[500, 700]::real[], ARRAY[60, 30]::real[] FROM series WHERE name = 'spindle_power_w';
INSERT INTO hour_means (series_id, box_id, day, mean, least, greatest, seconds)
SELECT series_id, 1, '2026-10-25 00:00:00+00', ARRAY[0.1, 0.2]::real[], ARRAY[0.1, 0.1]::real[], ARRAY[0.125, 0.25]::real[], ARRAY[3600, 3600]::real[] FROM series WHERE name = 'tool_wear_mm';
INSERT INTO refused (received, stream_sequence, subject, reason, payload) VALUES ('2026-10-25 10:00:00+00', 1, 'cnc.A.sample', 'no JSON', 'x'), ('2026-10-20 10:00:00+00', 2, 'cnc.A.sample', 'older', 'x');
UPDATE box_latest SET last_arrival = now() - interval '1 hour' WHERE box_id = 1;
