-- Energy of each machine and day (UTC), the last seven days: all of it, also between parts. From the power of the whole machine where
-- there is one, else from that of the spindle; the running hour from its minutes.
WITH power AS (
  SELECT box_id, name, at, mean * seconds AS joule FROM hours
  WHERE name IN ('total_power_w', 'spindle_power_w') AND day >= date_trunc('day', now() - interval '7 days') AND at < date_trunc('hour', now())
  UNION ALL
  SELECT box_id, name, at, mean * seconds FROM minutes
  WHERE name IN ('total_power_w', 'spindle_power_w') AND hour = date_trunc('hour', now())
), measured AS (
  SELECT box_id, name, at, joule, bool_or(name = 'total_power_w') OVER (PARTITION BY box_id) AS whole FROM power
)
SELECT label AS machine, date_trunc('day', at)::date AS day, sum(joule) / 3.6e6 AS kwh
FROM measured JOIN labels USING (box_id)
WHERE name = CASE WHEN whole THEN 'total_power_w' ELSE 'spindle_power_w' END
GROUP BY label, date_trunc('day', at)
ORDER BY label, day;
