-- Mean power of each machine while it cuts, the last six hours, weighted by the time for which each value held.
WITH stretch AS (
  SELECT box_id, greatest(since, now() - interval '6 hours') AS begins, least(coalesce(until, last_at), now()) AS ends
  FROM state_list JOIN box_latest USING (box_id)
  WHERE state = 'cutting' AND since >= now() - interval '37 days' AND since < now() AND coalesce(until, now()) > now() - interval '6 hours'
), spent AS (
  SELECT box_id, number, extract(epoch FROM coalesce(lead(at) OVER (PARTITION BY box_id, begins ORDER BY at, sequence), ends) - greatest(at, begins))::float8 AS seconds
  FROM stretch CROSS JOIN (SELECT series_id FROM series WHERE name = 'spindle_power_w') AS wanted
  CROSS JOIN LATERAL (
    -- The value that holds when the cut begins is up to an hour older: a box repeats every value at least so often.
    (SELECT at, sequence, numbers[array_position(series, series_id)] AS number FROM items
     WHERE items.box_id = stretch.box_id AND at <= begins AND at > begins - interval '1 hour' AND (kind = 'gap' OR (kind = 'sample' AND series @> ARRAY[series_id]))
     ORDER BY at DESC, sequence DESC LIMIT 1)
    UNION ALL
    SELECT at, sequence, numbers[array_position(series, series_id)] FROM items
    WHERE items.box_id = stretch.box_id AND at > begins AND at < ends AND (kind = 'gap' OR (kind = 'sample' AND series @> ARRAY[series_id]))
  ) AS told
), known AS (
  SELECT box_id, sum(number * seconds) AS joule, sum(seconds) AS seconds FROM spent WHERE number IS NOT NULL AND seconds > 0 GROUP BY box_id
)
SELECT label AS machine, sum(joule) / sum(seconds) AS mean_w, sum(seconds) / 3600 AS hours_cutting
FROM known JOIN labels USING (box_id)
GROUP BY label
ORDER BY label;
