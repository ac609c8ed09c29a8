-- Mean power of each machine over the last six hours, weighted by the time for which each value held.
WITH spent AS (
  -- All machines in one pass: their items lie beside each other in the order of time. The value that held when the six hours began is up to an
  -- hour older: a box repeats every value at least so often.
  SELECT box_id, series_id, number,
         date_part('epoch', least(coalesce(lead(at) OVER (PARTITION BY box_id, series_id ORDER BY at, sequence), last_at), now()) - greatest(at, now() - interval '6 hours')) AS seconds
  FROM (
    -- OFFSET 0: the number is taken out before the rows are sorted.
    SELECT box_id, series_id, at, sequence, last_at, numbers[array_position(series, series_id)] AS number
    FROM items JOIN box_latest USING (box_id) CROSS JOIN (SELECT series_id FROM series WHERE name = 'spindle_power_w') AS wanted
    WHERE at >= now() - interval '7 hours' AND at < now() AND (kind = 'gap' OR (kind = 'sample' AND series @> ARRAY[series_id]))
    OFFSET 0
  ) AS told
), known AS (
  SELECT box_id, series_id, sum(number * seconds) AS total, sum(seconds) AS seconds FROM spent WHERE number IS NOT NULL AND seconds > 0 GROUP BY box_id, series_id
)
SELECT label AS machine, name, unit, sum(total) / sum(seconds) AS mean, sum(seconds) / 3600 AS hours_known
FROM known JOIN series USING (series_id) JOIN labels USING (box_id)
GROUP BY label, name, unit
ORDER BY label;
