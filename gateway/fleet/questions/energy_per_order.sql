-- Parts, scrap and energy of each order on each machine, of the orders that ran in the last seven days. An order runs from its fact until the
-- next one of the machine; its parts are those that ended meanwhile, its scrap what was told of that time.
WITH running AS (
  SELECT label, value AS order_number, parts AS planned, since, until FROM facts WHERE fact = 'order'
), recent AS (
  SELECT * FROM running WHERE order_number <> '' AND coalesce(until, now()) > now() - interval '7 days' AND since < now()
), done AS (
  SELECT label, parts.ended, count, energy_j FROM parts
  JOIN placements AS place ON place.box_id = parts.box_id AND ended >= place.since AND ended < place.until
  WHERE ended >= (SELECT min(since) FROM recent)
), made AS (
  SELECT label, since, sum(count) AS parts, sum(energy_j) AS energy_j
  FROM recent JOIN done USING (label) WHERE ended >= since AND (until IS NULL OR ended < until) GROUP BY label, since
), lost AS (
  SELECT recent.label, recent.since, sum(facts.parts) AS scrap
  FROM recent JOIN facts ON facts.label = recent.label AND fact = 'scrap' AND facts.since >= recent.since AND (recent.until IS NULL OR facts.since < recent.until)
  GROUP BY recent.label, recent.since
)
SELECT label AS machine, order_number, min(since) AS first_at, max(coalesce(until, now())) AS last_at, max(planned) AS planned, sum(parts) AS parts, sum(scrap) AS scrap,
       sum(energy_j) / 3.6e6 AS kwh, sum(energy_j) / nullif(sum(parts) - coalesce(sum(scrap), 0), 0) / 3600 AS wh_per_good_part
FROM recent LEFT JOIN made USING (label, since) LEFT JOIN lost USING (label, since)
GROUP BY label, order_number
ORDER BY label, first_at;
