-- Mean power of each machine over the last six hours, weighted by the time for which each value held.
SELECT machine, name, unit, sum(number * seconds) / sum(seconds) AS mean, sum(seconds) / 3600 AS hours_known
FROM readings
WHERE name = 'spindle_power_w' AND valid_from >= now() - interval '6 hours' AND number IS NOT NULL AND seconds > 0
GROUP BY machine, name, unit
ORDER BY machine;
