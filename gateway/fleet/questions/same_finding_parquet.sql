-- The same question over Parquet partitions, for DuckDB in the directory that holds `samples` and `diagnoses`.
WITH found AS (
  SELECT machine, time_utc, unnest(from_json(diagnosis -> 'missing', '["JSON"]')) ->> 'effect' AS effect
  FROM read_parquet('diagnoses/*/*/*.parquet', hive_partitioning = true)
)
SELECT effect, count(DISTINCT machine) AS machines, count(*) AS diagnoses, min(time_utc) AS first_at, max(time_utc) AS last_at,
       string_agg(DISTINCT machine, ', ' ORDER BY machine) AS which
FROM found
GROUP BY effect
ORDER BY machines DESC, diagnoses DESC, effect;
