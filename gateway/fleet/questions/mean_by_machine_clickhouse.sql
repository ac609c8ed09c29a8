-- The same for ClickHouse (`clickhouse local`, chdb) in the directory that holds `samples`.
SELECT machine, date, avg(spindle_power_w) AS mean_w, count(spindle_power_w) AS ticks
FROM file('samples/*/*/*.parquet', Parquet)
GROUP BY machine, date
ORDER BY machine, date
SETTINGS use_hive_partitioning = 1;
