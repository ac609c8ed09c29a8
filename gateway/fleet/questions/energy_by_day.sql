-- Energy of each machine and day (UTC), the last seven days: all of it, also between parts.
SELECT coalesce(path, label) AS machine, (day AT TIME ZONE 'UTC')::date AS day, sum(kwh) AS kwh
FROM energy_by_day JOIN labels USING (box_id)
WHERE day >= date_trunc('day', now() - interval '7 days', 'UTC') AND day <= now()
GROUP BY 1, 2
ORDER BY 1, 2;
