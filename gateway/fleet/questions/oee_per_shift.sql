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
  SELECT shift, day, begins, ends, least(ends, now()) AS over FROM shift WHERE begins < now() AND ends > now() - interval '7 days'
), stay AS MATERIALIZED (
  -- The part of the shift in which a box stood at a machine: another box may have taken its place.
  SELECT shift, day, greatest(begins, since) AS begins, least(ends, until) AS ends, box_id, label
  FROM done JOIN placements ON since < ends AND until > begins
), fact AS MATERIALIZED (
  SELECT label, fact, fact_list.since, fact_list.until, parts
  FROM fact_list JOIN placements AS place ON place.box_id = fact_list.box_id AND fact_list.since >= place.since AND fact_list.since < place.until
  WHERE fact = 'planned_time' OR (fact = 'scrap' AND fact_list.since > now() - interval '9 days')
), plan AS (
  -- What was planned of a machine, and since when there are plans of it.
  SELECT label, range_agg(tstzrange(since, until)) FILTER (WHERE until > now() - interval '9 days') AS planned, min(since) AS first
  FROM fact WHERE fact = 'planned_time' AND until > since GROUP BY label
), part AS MATERIALIZED (
  -- The box tells how long each part was in each state.
  SELECT box_id, program, count, began, ended,
         CASE jsonb_typeof(detail -> 'seconds') WHEN 'object' THEN
           (SELECT sum(value::float8) FILTER (WHERE fleet_is_at_work(key)) FROM jsonb_each_text(detail -> 'seconds')) END AS work_s
  FROM part_list WHERE ended >= now() - interval '8 days' AND count > 0
), asked AS MATERIALIZED (
  -- Stretches of time of which the states say how long a box was at work: shifts, and what was planned in them;
  SELECT shift, day, label, false AS planned, box_id, begins, least(ends, now()) AS ends FROM stay WHERE begins < now()
  UNION ALL
  SELECT shift, day, label, true, box_id, lower(piece), upper(piece)
  FROM stay JOIN plan USING (label) CROSS JOIN LATERAL unnest(planned * tstzmultirange(tstzrange(begins, greatest(begins, least(ends, now()))))) AS piece
), span AS MATERIALIZED (
  -- and cycles where the box has not told it.
  SELECT box_id, begins, ends FROM asked UNION SELECT box_id, began, ended FROM part WHERE work_s IS NULL
), oldest AS MATERIALIZED (
  SELECT box_id, min(begins) AS begins FROM span GROUP BY box_id
), spent AS MATERIALIZED (
  -- Known time and time at work from the oldest state to the end of each stretch, less those to its beginning. Of the state that runs at a
  -- moment, only what is over counts; `running` is its beginning with what it is in the last two bits.
  SELECT box_id, begins, ends, sum(sign * (known_us - (running & 2) / 2 * left_us)) / 1e6 AS known_s, sum(sign * (work_us - (running & 1) * left_us)) / 1e6 AS work_s,
         bool_or(sign = 1 AND running > 0) AS has_state
  FROM (
    SELECT box_id, begins, ends, sign, coalesce(sum(known_us) OVER so_far, 0) AS known_us, coalesce(sum(work_us) OVER so_far, 0) AS work_us,
           coalesce(max(running) OVER so_far, 0) AS running, greatest(date_part('epoch', max(until) OVER so_far - at) * 1e6, 0) AS left_us
    FROM (
      SELECT box_id, since AS at, over AS until, known * lasts_us AS known_us, work * lasts_us AS work_us, (date_part('epoch', since) * 1e6)::bigint * 4 + 2 * known + work AS running,
             NULL::timestamptz AS begins, NULL::timestamptz AS ends, 0 AS sign
      FROM oldest JOIN box_latest USING (box_id)
      CROSS JOIN LATERAL (
        SELECT since, coalesce(until, last_at) AS over, state FROM state_list WHERE state_list.box_id = oldest.box_id AND since >= begins AND since < now()
        UNION ALL
        (SELECT since, coalesce(until, last_at), state FROM state_list WHERE state_list.box_id = oldest.box_id AND since < begins ORDER BY since DESC, epoch DESC, sequence DESC LIMIT 1)
      ) AS near
      CROSS JOIN LATERAL (SELECT (state <> 'no_data')::int AS known, fleet_is_at_work(state)::int AS work, date_part('epoch', over - since) * 1e6 AS lasts_us) AS it
      WHERE over > since
      UNION ALL SELECT box_id, begins, NULL, NULL, NULL, NULL, begins, ends, -1 FROM span
      UNION ALL SELECT box_id, ends, NULL, NULL, NULL, NULL, begins, ends, 1 FROM span
    ) AS told
    WINDOW so_far AS (PARTITION BY box_id ORDER BY at, sign = 0 ROWS UNBOUNDED PRECEDING)
  ) AS counted
  WHERE sign <> 0
  GROUP BY box_id, begins, ends
), cycle AS MATERIALIZED (
  SELECT part.box_id, program, count, began, ended, coalesce(part.work_s, nullif(spent.work_s, 0)) / count AS seconds
  FROM part LEFT JOIN spent ON part.work_s IS NULL AND spent.box_id = part.box_id AND spent.begins = began AND spent.ends = ended
), fastest AS (
  SELECT coalesce(program, '') AS program, percentile_cont(0.1) WITHIN GROUP (ORDER BY seconds) AS seconds FROM cycle GROUP BY 1
), share AS (
  SELECT stay.box_id, begins, ends, sum(count) FILTER (WHERE ended >= begins AND ended < ends) AS parts,
         sum(count * target * CASE WHEN ended > began THEN date_part('epoch', least(ended, ends) - greatest(began, begins)) / date_part('epoch', ended - began) ELSE 1 END) AS target_s,
         bool_and(target IS NOT NULL) AS has_targets
  FROM (SELECT DISTINCT box_id, begins, ends FROM stay) AS stay
  JOIN (
    SELECT box_id, began, ended, count, coalesce(cycle_targets.seconds, fastest.seconds) AS target
    FROM cycle LEFT JOIN fastest ON fastest.program = coalesce(cycle.program, '') LEFT JOIN cycle_targets ON cycle_targets.program = cycle.program
  ) AS aimed ON aimed.box_id = stay.box_id AND ended >= begins AND began < ends
  GROUP BY stay.box_id, begins, ends
), total AS (
  SELECT shift, day, label, nullif(sum(known_s), 0) AS known_s, sum(work_s) AS work_s, sum(work_planned_s) AS work_planned_s, sum(parts) AS parts,
         CASE WHEN bool_and(has_targets) THEN sum(target_s) END AS target_s, bool_or(is_planned) AS is_planned, sum(planned_s) AS planned_s, sum(scrap) AS scrap
  FROM (
    SELECT shift, day, label, has_state, CASE WHEN NOT planned THEN known_s END AS known_s, CASE WHEN NOT planned THEN work_s END AS work_s, CASE WHEN planned THEN work_s END AS work_planned_s,
           NULL::bigint AS parts, NULL::float8 AS target_s, NULL::boolean AS has_targets, NULL::boolean AS is_planned, NULL::float8 AS planned_s, NULL::numeric AS scrap
    FROM asked JOIN spent USING (box_id, begins, ends)
    UNION ALL
    SELECT shift, day, label, NULL, NULL, NULL, NULL, parts, target_s, has_targets, NULL, NULL, NULL FROM stay JOIN share USING (box_id, begins, ends)
    UNION ALL
    SELECT shift, day, label, NULL, NULL, NULL, NULL, NULL, NULL, NULL, true, date_part('epoch', upper(piece) - lower(piece)), NULL
    FROM done JOIN plan ON first < ends LEFT JOIN LATERAL unnest(planned * tstzmultirange(tstzrange(begins, over))) AS piece ON true
    UNION ALL
    SELECT shift, day, label, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL, NULL, parts FROM done JOIN fact ON fact = 'scrap' AND since >= begins AND since < ends
  ) AS told
  GROUP BY shift, day, label HAVING bool_or(has_state)
)
SELECT label AS machine, shift, day, parts, availability, performance, availability * performance * coalesce(quality, 1) AS oee,
       known_s / 3600 AS hours_known, quality, scrap, planned_s / 3600 AS hours_planned
FROM total CROSS JOIN LATERAL (
  SELECT CASE WHEN is_planned THEN coalesce(work_planned_s, 0) / nullif(planned_s, 0) ELSE work_s / known_s END AS availability,
         target_s / nullif(work_s, 0) AS performance, 1 - scrap / nullif(parts, 0)::float8 AS quality
) AS ratio
ORDER BY label, day, shift;
