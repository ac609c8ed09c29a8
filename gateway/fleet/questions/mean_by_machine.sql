-- Mean power of each machine over the last six hours, weighted by the time for which each value held.
WITH wanted AS (
  SELECT series_id, name, unit FROM series WHERE name = 'spindle_power_w'
), told AS (
  -- The value that held when the six hours began is up to an hour older: a box repeats every value at least so often.
  SELECT items.box_id, series_id, name, unit, at, sequence, numbers[array_position(series, series_id)] AS number
  FROM wanted JOIN items ON kind = 'gap' OR (kind = 'sample' AND series @> ARRAY[series_id])
  WHERE at >= now() - interval '7 hours' AND at < now()
), held AS (
  SELECT box_id, name, unit, number, greatest(at, now() - interval '6 hours') AS since,
         least(coalesce(lead(at) OVER (PARTITION BY box_id, series_id ORDER BY at, sequence), last_at), now()) AS until
  FROM told JOIN box_latest USING (box_id)
), spent AS (
  SELECT box_id, name, unit, number, extract(epoch FROM until - since)::float8 AS seconds FROM held WHERE number IS NOT NULL AND until > since
)
SELECT label AS machine, name, unit, sum(number * seconds) / sum(seconds) AS mean, sum(seconds) / 3600 AS hours_known
FROM spent JOIN labels USING (box_id)
GROUP BY label, name, unit
ORDER BY label;
