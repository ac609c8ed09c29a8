-- From the table `incoming`, which holds the records of a batch, into the tables of each kind; every statement may be repeated.
INSERT INTO part_list (sequence, began, ended, box_id, part, program, count, cutting_s, energy_j, detail)
SELECT sequence, fleet_time((record ->> 'began_ns')::bigint), at, box_id, record ->> 'part', record ->> 'program', coalesce((record ->> 'count')::bigint, 1),
       (record ->> 'cutting_s')::float8, (record ->> 'energy_j')::float8, record -> 'detail'
FROM incoming WHERE kind = 'part' ON CONFLICT DO NOTHING;

INSERT INTO operation_list (sequence, ended, box_id, place, operation, program, part, seconds, cutting_s, energy_j, mean_power_w)
SELECT sequence, at, box_id, place, one ->> 'operation', record ->> 'program', record ->> 'part', (one ->> 'seconds')::float8,
       (one ->> 'cutting_s')::float8, (one ->> 'energy_j')::float8, (one ->> 'mean_power_w')::float8
FROM incoming
CROSS JOIN LATERAL jsonb_array_elements(
  CASE jsonb_typeof(record -> 'detail' -> 'operations') WHEN 'array' THEN record -> 'detail' -> 'operations' ELSE '[]' END
) WITH ORDINALITY AS operations (one, place)
WHERE kind = 'part' ON CONFLICT DO NOTHING;

INSERT INTO alarm_marks (box_id, source, code, at, raised, sequence, severity, en, zh)
SELECT box_id, coalesce(record ->> 'source', ''), coalesce(record ->> 'code', ''), at, kind = 'alarm', sequence,
       record ->> 'severity', record ->> 'en', record ->> 'zh'
FROM incoming WHERE kind IN ('alarm', 'alarm_clear') ON CONFLICT DO NOTHING;

INSERT INTO event_list (box_id, at, sequence, kind, source, text, detail)
SELECT box_id, at, sequence, record ->> 'kind', record ->> 'source', record ->> 'text', record -> 'detail'
FROM incoming WHERE kind = 'event' ON CONFLICT DO NOTHING;

INSERT INTO decision_list (box_id, at, sequence, decision)
SELECT box_id, at, sequence, record FROM incoming WHERE kind = 'decision' AND record IS NOT NULL ON CONFLICT DO NOTHING;

INSERT INTO diagnosis_list (box_id, at, sequence, verdict, summary, diagnosis)
SELECT box_id, at, sequence, record ->> 'verdict', record ->> 'summary', record -> 'json'
FROM incoming WHERE kind = 'diagnosis' ON CONFLICT DO NOTHING;

-- The end of a gap comes later than its beginning.
INSERT INTO gap_list AS known (box_id, since, until, reason, sequence)
SELECT DISTINCT ON (box_id, at) box_id, at, fleet_time((record ->> 'until_ns')::bigint), coalesce(record ->> 'reason', ''), sequence
FROM incoming WHERE kind = 'gap' ORDER BY box_id, at, sequence DESC
ON CONFLICT (box_id, since) DO UPDATE SET until = coalesce(excluded.until, known.until), reason = excluded.reason
WHERE excluded.sequence > known.sequence;

-- A stretch of a state ends where the next one of its box begins. One at a time: two that do not see each other's rows would both
-- leave the end open.
SELECT pg_advisory_xact_lock(109217386592050);
INSERT INTO state_list (sequence, since, box_id, state, program, tool)
SELECT sequence, at, box_id, coalesce(record ->> 'state', 'unknown'), nullif(record ->> 'program', ''), nullif(record ->> 'tool', '')
FROM incoming WHERE kind = 'state' ON CONFLICT DO NOTHING;
INSERT INTO state_list (sequence, since, box_id, state, reason)
SELECT sequence, at, box_id, 'no_data', record ->> 'reason' FROM incoming WHERE kind = 'gap' ON CONFLICT DO NOTHING;
-- After a gap in a running box its state goes on; a box that was started tells it anew.
INSERT INTO state_list (sequence, since, box_id, state, program, tool)
SELECT gap.sequence, fleet_time((gap.record ->> 'until_ns')::bigint), gap.box_id, before.state, before.program, before.tool
FROM incoming AS gap
CROSS JOIN LATERAL (
  SELECT state, program, tool FROM state_list WHERE box_id = gap.box_id AND since < gap.at ORDER BY since DESC, sequence DESC LIMIT 1
) AS before
WHERE gap.kind = 'gap' AND gap.record ->> 'reason' = 'no_samples' AND gap.record ->> 'until_ns' IS NOT NULL ON CONFLICT DO NOTHING;
UPDATE state_list AS changed SET until = found.until
FROM (
  SELECT box_id, since, sequence, lead(since) OVER (PARTITION BY box_id ORDER BY since, sequence) AS until
  FROM (
    SELECT box_id AS touched_box, min(at) AS low, max(greatest(at, fleet_time((record ->> 'until_ns')::bigint))) AS high
    FROM incoming WHERE kind IN ('state', 'gap') GROUP BY box_id
  ) AS touched
  CROSS JOIN LATERAL (
    (SELECT box_id, since, sequence FROM state_list WHERE box_id = touched_box AND since < low ORDER BY since DESC, sequence DESC LIMIT 1)
    UNION ALL
    (SELECT box_id, since, sequence FROM state_list WHERE box_id = touched_box AND since >= low AND since <= high)
    UNION ALL
    (SELECT box_id, since, sequence FROM state_list WHERE box_id = touched_box AND since > high ORDER BY since, sequence LIMIT 1)
  ) AS near
) AS found
WHERE changed.box_id = found.box_id AND changed.since = found.since AND changed.sequence = found.sequence
  AND found.until IS NOT NULL AND changed.until IS DISTINCT FROM found.until;
