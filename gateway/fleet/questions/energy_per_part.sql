-- Energy for a part, by machine and program, the last seven days.
SELECT label AS machine, program, sum(count) AS parts, sum(energy_j) / 3.6e6 AS kwh, sum(energy_j) / sum(count) / 3600 AS wh_per_part,
       sum(seconds) / sum(count) AS seconds_per_part
FROM parts JOIN labels USING (box_id)
WHERE ended >= now() - interval '7 days' AND energy_j IS NOT NULL AND count > 0
GROUP BY label, program
ORDER BY kwh DESC;
