-- OEE of each machine in each shift of the last seven days. Availability: time with the spindle or an axis at work, of the time of the
-- shift of which something is known; where somebody has told what was planned (planned_time), time at work within it, of the time that
-- was planned, from the first plan on. Performance: what the parts would have taken, of the time at work; both are times at work, without
-- the standby between parts. What a part would have taken is in `cycle_targets`, or else the fastest tenth of the cycles of its
-- program. A part counts for a shift by the share of its cycle that lies in it. Without parts, or with one whose program has no target,
-- performance is not known, and no OEE. Quality: 1 - scrap / parts, where somebody has told scrap of the shift; otherwise it counts as 1.
WITH shift AS (
  SELECT shift, today - n AS day, (today - n + starts) AT TIME ZONE zone AS begins,
         (today - n + ends + CASE WHEN ends <= starts THEN interval '1 day' ELSE interval '0' END) AT TIME ZONE zone AS ends
  FROM shifts CROSS JOIN LATERAL (SELECT (now() AT TIME ZONE zone)::date AS today) AS here CROSS JOIN generate_series(0, 8) AS n
), done AS (
  SELECT * FROM shift WHERE begins < now() AND ends > now() - interval '7 days'
), stay AS (
  -- The part of the shift in which a box stood at a machine: another box may have taken its place.
  SELECT shift, day, greatest(begins, since) AS begins, least(ends, until) AS ends, box_id, label
  FROM done JOIN placements ON since < ends AND until > begins
), plan AS (
  -- What was planned of a machine, and since when there are plans of it.
  SELECT label, range_agg(tstzrange(since, until)) FILTER (WHERE until > now() - interval '9 days') AS planned, min(since) AS first
  FROM facts WHERE fact = 'planned_time' AND until > since GROUP BY label
), wanted AS (
  SELECT shift, day, label, sum(extract(epoch FROM upper(part) - lower(part)))::float8 AS planned_s
  FROM done JOIN plan ON first < ends
  LEFT JOIN LATERAL unnest(planned * tstzmultirange(tstzrange(begins, greatest(begins, least(ends, now()))))) AS part ON true
  GROUP BY shift, day, label
), scrapped AS (
  SELECT shift, day, label, sum(parts) AS scrap FROM done JOIN facts ON fact = 'scrap' AND since >= begins AND since < ends GROUP BY shift, day, label
), stretch AS (
  -- By box, so that each shift reads its own rows by the key; OFFSET 0 keeps the planner from joining otherwise.
  SELECT shift, day, label, begins, ends, stay.box_id, begun.state, begun.since, begun.until
  FROM stay CROSS JOIN LATERAL (
    SELECT state, since, until FROM state_list WHERE state_list.box_id = stay.box_id AND since >= begins AND since < stay.ends OFFSET 0
  ) AS begun
  UNION ALL
  SELECT shift, day, label, begins, ends, stay.box_id, running.state, running.since, running.until
  FROM stay CROSS JOIN LATERAL (
    SELECT state, since, until FROM state_list
    WHERE state_list.box_id = stay.box_id AND since < begins ORDER BY since DESC, epoch DESC, sequence DESC LIMIT 1
  ) AS running
), spent AS (
  SELECT shift, day, label,
         sum(seconds) FILTER (WHERE state <> 'no_data') AS known_s,
         sum(seconds) FILTER (WHERE fleet_is_at_work(state)) AS at_work_s,
         sum(within.seconds_planned) FILTER (WHERE fleet_is_at_work(state)) AS work_planned_s
  FROM stretch LEFT JOIN box_latest USING (box_id) LEFT JOIN plan USING (label)
  CROSS JOIN LATERAL (
    SELECT greatest(extract(epoch FROM least(coalesce(until, last_at), ends, now()) - greatest(since, begins)), 0)::float8 AS seconds
  ) AS length
  LEFT JOIN LATERAL (
    SELECT sum(extract(epoch FROM upper(part) - lower(part)))::float8 AS seconds_planned
    FROM unnest(planned * tstzmultirange(tstzrange(greatest(since, begins), greatest(since, begins) + seconds * interval '1 second'))) AS part
  ) AS within ON fleet_is_at_work(state)
  GROUP BY shift, day, label
), cycle AS (
  SELECT box_id, program, count, began, ended, work.seconds / count AS seconds
  FROM part_list
  -- The box tells how long each part was in each state; where it did not, the stretches of the states say it.
  CROSS JOIN LATERAL (
    SELECT coalesce(
      (SELECT sum(value::text::float8) FILTER (WHERE fleet_is_at_work(key))
       FROM jsonb_each(CASE jsonb_typeof(detail -> 'seconds') WHEN 'object' THEN detail -> 'seconds' ELSE '{}' END)),
      (SELECT sum(extract(epoch FROM least(coalesce(until, ended), ended) - greatest(since, began)))::float8
       FROM (
         -- What ran when the cycle began, and what has begun since.
         (SELECT state, since, until FROM state_list
          WHERE state_list.box_id = part_list.box_id AND since <= began AND since > began - interval '1 day'
          ORDER BY since DESC, epoch DESC, sequence DESC LIMIT 1)
         UNION ALL
         SELECT state, since, until FROM state_list WHERE state_list.box_id = part_list.box_id AND since > began AND since < ended
       ) AS near
       WHERE coalesce(until, ended) > began AND fleet_is_at_work(state))) AS seconds
  ) AS work
  WHERE ended >= now() - interval '8 days' AND count > 0
), fastest AS (
  SELECT coalesce(program, '') AS program, percentile_cont(0.1) WITHIN GROUP (ORDER BY seconds) AS seconds FROM cycle GROUP BY 1
), made AS (
  SELECT shift, day, label, sum(count) FILTER (WHERE ended >= begins AND ended < ends) AS parts,
         CASE WHEN bool_and(target IS NOT NULL) THEN sum(count * target * share) END AS target_s
  FROM (
    SELECT shift, day, label, begins, ends, count, ended, coalesce(cycle_targets.seconds, fastest.seconds) AS target,
           CASE WHEN ended > began THEN extract(epoch FROM least(ended, ends) - greatest(began, begins)) / extract(epoch FROM ended - began)
                ELSE 1 END::float8 AS share
    FROM stay JOIN cycle ON cycle.box_id = stay.box_id AND ended >= begins AND began < ends
    LEFT JOIN fastest ON fastest.program = coalesce(cycle.program, '')
    LEFT JOIN cycle_targets ON cycle_targets.program = cycle.program
  ) AS shared
  GROUP BY shift, day, label
)
SELECT label AS machine, shift, day, parts, availability, performance, availability * performance * coalesce(quality, 1) AS oee,
       known_s / 3600 AS hours_known, quality, scrap, planned_s / 3600 AS hours_planned
FROM spent LEFT JOIN made USING (shift, day, label) LEFT JOIN wanted USING (shift, day, label) LEFT JOIN scrapped USING (shift, day, label)
LEFT JOIN plan USING (label)
CROSS JOIN LATERAL (
  SELECT CASE WHEN wanted.shift IS NULL THEN at_work_s / nullif(known_s, 0) ELSE coalesce(work_planned_s, 0) / nullif(planned_s, 0) END AS availability,
         target_s / nullif(at_work_s, 0) AS performance, 1 - scrap / nullif(parts, 0)::float8 AS quality
) AS share
ORDER BY label, day, shift;
