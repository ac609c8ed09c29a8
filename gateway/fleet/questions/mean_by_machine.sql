-- Mean power of each machine over the last six hours, weighted by the time for which each value held.
WITH spent AS (
  SELECT boxes.box_id, series_id, number, seconds
  FROM boxes JOIN box_latest USING (box_id) CROSS JOIN (SELECT series_id FROM series WHERE name = 'spindle_power_w') AS wanted
  CROSS JOIN LATERAL (
    -- The value that held when the six hours began is up to an hour older: a box repeats every value at least so often.
    SELECT numbers[array_position(series, wanted.series_id)] AS number,
           extract(epoch FROM least(coalesce(lead(at) OVER (ORDER BY at, sequence), last_at), now()) - greatest(at, now() - interval '6 hours'))::float8 AS seconds
    FROM items
    WHERE items.box_id = boxes.box_id AND at >= now() - interval '7 hours' AND at < now() AND (kind = 'gap' OR (kind = 'sample' AND series @> ARRAY[wanted.series_id]))
  ) AS held
), known AS (
  SELECT box_id, series_id, sum(number * seconds) AS total, sum(seconds) AS seconds FROM spent WHERE number IS NOT NULL AND seconds > 0 GROUP BY box_id, series_id
)
SELECT label AS machine, name, unit, sum(total) / sum(seconds) AS mean, sum(seconds) / 3600 AS hours_known
FROM known JOIN series USING (series_id) JOIN labels USING (box_id)
GROUP BY label, name, unit
ORDER BY label;
