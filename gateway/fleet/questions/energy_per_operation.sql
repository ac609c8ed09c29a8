-- Energy, time and mean power by program and operation over all machines, the last seven days.
SELECT program, operation, count(*) AS times, sum(seconds) AS seconds, sum(cutting_s) AS cutting_s, sum(energy_j) / 3.6e6 AS kwh,
       sum(energy_j) / nullif(sum(seconds) FILTER (WHERE energy_j IS NOT NULL), 0) AS mean_power_w
FROM operations
WHERE ended >= now() - interval '7 days'
GROUP BY program, operation
ORDER BY kwh DESC NULLS LAST;
