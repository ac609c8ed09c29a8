-- OEE of each machine in each shift of the last seven days. Availability: time with the spindle or an axis at work, of the time of the
-- shift of which something is known. Performance: what the parts would have taken by `cycle_targets` (where a program is missing there:
-- by the fastest tenth of its cycles), of the time at work. Quality is known to nobody here and counts as 1.
WITH shift AS (
  SELECT shift, day, (day + starts) AT TIME ZONE zone AS begins,
         (day + ends + CASE WHEN ends <= starts THEN interval '1 day' ELSE interval '0' END) AT TIME ZONE zone AS ends
  FROM shifts CROSS JOIN LATERAL (SELECT (current_date - n)::timestamp AS day FROM generate_series(0, 7) AS n) AS days
), done AS (
  SELECT * FROM shift WHERE begins < now() AND ends > now() - interval '7 days'
), stretch AS (
  SELECT done.shift, done.day, done.begins, done.ends, box_id, state, since, until FROM done JOIN state_list ON since >= begins AND since < ends
  UNION ALL
  SELECT done.shift, done.day, done.begins, done.ends, boxes.box_id, running.state, running.since, running.until
  FROM done CROSS JOIN boxes CROSS JOIN LATERAL (
    SELECT state, since, until FROM state_list WHERE state_list.box_id = boxes.box_id AND since < begins ORDER BY since DESC, sequence DESC LIMIT 1
  ) AS running
), spent AS (
  SELECT shift, day, box_id,
         sum(seconds) FILTER (WHERE state <> 'no_data') AS known_s,
         sum(seconds) FILTER (WHERE state IN ('spindle_start', 'idle', 'cutting', 'rapid', 'speed_change')) AS at_work_s
  FROM stretch LEFT JOIN box_latest USING (box_id)
  CROSS JOIN LATERAL (
    SELECT greatest(extract(epoch FROM least(coalesce(until, last_at), ends, now()) - greatest(since, begins)), 0)::float8 AS seconds
  ) AS length
  GROUP BY shift, day, box_id
), fastest AS (
  SELECT program, percentile_cont(0.1) WITHIN GROUP (ORDER BY extract(epoch FROM ended - began) / count) AS seconds
  FROM part_list WHERE ended >= now() - interval '7 days' AND count > 0 GROUP BY program
), made AS (
  SELECT done.shift, done.day, part_list.box_id, sum(count) AS parts, sum(count * coalesce(cycle_targets.seconds, fastest.seconds)) AS target_s
  FROM done JOIN part_list ON ended >= begins AND ended < ends
  LEFT JOIN fastest ON fastest.program IS NOT DISTINCT FROM part_list.program LEFT JOIN cycle_targets ON cycle_targets.program = part_list.program
  GROUP BY done.shift, done.day, part_list.box_id
)
SELECT machine, shift, day::date AS day, parts, at_work_s / nullif(known_s, 0) AS availability,
       least(target_s / nullif(at_work_s, 0), 1) AS performance, at_work_s / nullif(known_s, 0) * least(target_s / nullif(at_work_s, 0), 1) AS oee,
       known_s / 3600 AS hours_known
FROM spent JOIN boxes USING (box_id) LEFT JOIN made USING (shift, day, box_id)
ORDER BY machine, day, shift;
