-- The same for ClickHouse (`clickhouse local`, chdb) in the directory that holds `samples`; it leaves %20 and the like in the names of
-- directories as they are.
SELECT decodeURLComponent(machine) AS name, date, avg(spindle_power_w) AS mean_w, count(spindle_power_w) AS ticks
FROM file('samples/*/*/*.parquet', Parquet)
GROUP BY name, date
ORDER BY name, date
SETTINGS use_hive_partitioning = 1;
