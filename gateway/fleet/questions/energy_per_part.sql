-- Energy for a part, by machine and program, the last seven days.
SELECT label AS machine, program, sum(count) AS parts, sum(energy_j) / 3.6e6 AS kwh, sum(energy_j) / sum(count) / 3600 AS wh_per_part,
       sum(seconds) / sum(count) AS seconds_per_part
FROM parts JOIN placements AS place ON place.box_id = parts.box_id AND ended >= place.since AND ended < place.until
WHERE ended >= now() - interval '7 days' AND energy_j IS NOT NULL AND count > 0
GROUP BY label, program
ORDER BY kwh DESC;
