-- Mean power of each machine and day, for DuckDB in the directory that holds `samples`; the rows of a day are equally far apart.
SELECT machine, date, avg(spindle_power_w) AS mean_w, count(spindle_power_w) AS ticks
FROM read_parquet('samples/*/*/*.parquet', hive_partitioning = true, union_by_name = true)
GROUP BY machine, date
ORDER BY machine, date;
