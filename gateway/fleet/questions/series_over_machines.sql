-- One series over all machines, a point per hour, the last week.
SELECT label AS machine, at, mean, least, greatest, seconds
FROM hours JOIN placements AS place ON place.box_id = hours.box_id AND at >= place.since AND at < place.until
WHERE name = 'spindle_power_w' AND day >= date_trunc('day', now() - interval '7 days', 'UTC') AND at >= now() - interval '7 days'
ORDER BY label, at;
