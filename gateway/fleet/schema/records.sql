-- From the table `incoming`, which holds the records of a batch, into the tables of each kind; every statement may be repeated.
INSERT INTO part_list (sequence, epoch, began, ended, box_id, part, program, count, cutting_s, energy_j, detail)
SELECT sequence, epoch, fleet_time((record ->> 'began_ns')::bigint), at, box_id, record ->> 'part', record ->> 'program', coalesce((record ->> 'count')::bigint, 1),
       (record ->> 'cutting_s')::float8, (record ->> 'energy_j')::float8, record -> 'detail'
FROM incoming WHERE kind = 'part' ON CONFLICT DO NOTHING;

INSERT INTO operation_list (sequence, epoch, ended, box_id, place, operation, program, part, seconds, cutting_s, energy_j, mean_power_w)
SELECT sequence, epoch, at, box_id, place, one ->> 'operation', record ->> 'program', record ->> 'part', (one ->> 'seconds')::float8,
       (one ->> 'cutting_s')::float8, (one ->> 'energy_j')::float8, (one ->> 'mean_power_w')::float8
FROM incoming
CROSS JOIN LATERAL jsonb_array_elements(
  CASE jsonb_typeof(record -> 'detail' -> 'operations') WHEN 'array' THEN record -> 'detail' -> 'operations' ELSE '[]' END
) WITH ORDINALITY AS operations (one, place)
WHERE kind = 'part' ON CONFLICT DO NOTHING;

INSERT INTO alarm_marks (box_id, source, code, at, raised, sequence, epoch, severity, en, zh)
SELECT box_id, coalesce(record ->> 'source', ''), coalesce(record ->> 'code', ''), at, kind = 'alarm', sequence, epoch,
       record ->> 'severity', record ->> 'en', record ->> 'zh'
FROM incoming WHERE kind IN ('alarm', 'alarm_clear') ON CONFLICT DO NOTHING;

INSERT INTO event_list (box_id, at, sequence, epoch, kind, source, text, detail)
SELECT box_id, at, sequence, epoch, record ->> 'kind', record ->> 'source', record ->> 'text', record -> 'detail'
FROM incoming WHERE kind = 'event' ON CONFLICT DO NOTHING;

INSERT INTO decision_list (box_id, at, sequence, epoch, decision)
SELECT box_id, at, sequence, epoch, record FROM incoming WHERE kind = 'decision' AND record IS NOT NULL ON CONFLICT DO NOTHING;

INSERT INTO diagnosis_list (box_id, at, sequence, epoch, verdict, summary, diagnosis)
SELECT box_id, at, sequence, epoch, record ->> 'verdict', record ->> 'summary', record -> 'json'
FROM incoming WHERE kind = 'diagnosis' ON CONFLICT DO NOTHING;

INSERT INTO fact_list (box_id, since, until, fact, value, parts, mark, way, author, at, sequence, epoch)
SELECT box_id, fleet_time((record ->> 'from_ns')::bigint), fleet_time((record ->> 'until_ns')::bigint), coalesce(record ->> 'fact', ''),
       coalesce(record ->> 'value', ''), (record ->> 'parts')::bigint, coalesce(record ->> 'mark', ''), record ->> 'way', record ->> 'author', at, sequence, epoch
FROM incoming WHERE kind = 'fact' AND record ->> 'from_ns' IS NOT NULL ON CONFLICT DO NOTHING;

-- The end of a gap comes later than its beginning.
INSERT INTO gap_list AS known (box_id, since, until, reason, sequence, epoch)
SELECT DISTINCT ON (box_id, at) box_id, at, fleet_time((record ->> 'until_ns')::bigint), coalesce(record ->> 'reason', ''), sequence, epoch
FROM incoming WHERE kind = 'gap' ORDER BY box_id, at, epoch DESC, sequence DESC
ON CONFLICT (box_id, since) DO UPDATE
  SET until = coalesce(excluded.until, known.until), reason = excluded.reason, sequence = excluded.sequence, epoch = excluded.epoch
WHERE (excluded.epoch, excluded.sequence) > (known.epoch, known.sequence);
-- One that has no end and one that has, of the same box and at almost the same time, are one: the clock was put right between them.
CREATE TEMP TABLE doubled ON COMMIT DROP AS
SELECT open.box_id, open.since, open.sequence, open.epoch FROM gap_list AS open
WHERE open.until IS NULL AND open.box_id IN (SELECT box_id FROM incoming WHERE kind = 'gap')
  AND EXISTS (SELECT FROM gap_list AS closed WHERE closed.box_id = open.box_id AND closed.until IS NOT NULL
    AND closed.since BETWEEN open.since - interval '1 second' AND open.since + interval '1 second');
DELETE FROM gap_list USING doubled WHERE (gap_list.box_id, gap_list.since) = (doubled.box_id, doubled.since);

-- A stretch of a state ends where the next one of its box begins. One at a time: two that do not see each other's rows would both
-- leave the end open.
SELECT pg_advisory_xact_lock(109217386592050);
INSERT INTO state_list (sequence, epoch, since, box_id, state, program, tool)
SELECT sequence, epoch, at, box_id, coalesce(record ->> 'state', 'unknown'), nullif(record ->> 'program', ''), nullif(record ->> 'tool', '')
FROM incoming WHERE kind = 'state' ON CONFLICT DO NOTHING;
INSERT INTO state_list (sequence, epoch, since, box_id, state, reason)
SELECT sequence, epoch, at, box_id, 'no_data', record ->> 'reason' FROM incoming WHERE kind = 'gap' ON CONFLICT DO NOTHING;
DELETE FROM state_list USING doubled WHERE state_list.box_id = doubled.box_id AND state_list.since = doubled.since
  AND (state_list.sequence, state_list.epoch) = (doubled.sequence, doubled.epoch);
-- After a gap in a running box its state goes on; a box that was started tells it anew.
INSERT INTO state_list (sequence, epoch, since, box_id, state, program, tool)
SELECT gap.sequence, gap.epoch, fleet_time((gap.record ->> 'until_ns')::bigint), gap.box_id, before.state, before.program, before.tool
FROM incoming AS gap
CROSS JOIN LATERAL (
  SELECT state, program, tool FROM state_list WHERE box_id = gap.box_id AND since < gap.at ORDER BY since DESC, epoch DESC, sequence DESC LIMIT 1
) AS before
WHERE gap.kind = 'gap' AND gap.record ->> 'reason' = 'no_samples' AND gap.record ->> 'until_ns' IS NOT NULL ON CONFLICT DO NOTHING;
SELECT fleet_join_states(box_id, min(at) - interval '1 second', max(greatest(at, fleet_time((record ->> 'until_ns')::bigint))))
FROM incoming WHERE kind IN ('state', 'gap') GROUP BY box_id ORDER BY box_id;
DROP TABLE doubled;
