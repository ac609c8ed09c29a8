-- The clock of a box had been wrong, and it tells which of its items are of another time: items and everything made of them move. In the
-- table `incoming` lie the events of this batch. What an item says of itself as `redated_ns` is done already, so all of it may be repeated.
CREATE TEMP TABLE told ON COMMIT DROP AS
SELECT box_id, epoch AS told_epoch, sequence AS told_sequence, place::int AS place, (one ->> 'epoch')::bigint AS epoch,
       (one ->> 'from_sequence')::bigint AS from_sequence, (one ->> 'to_sequence')::bigint AS to_sequence, (one ->> 'by_ns')::bigint AS by_ns,
       fleet_time((one ->> 'from_ns')::bigint) AS from_at, fleet_time((one ->> 'to_ns')::bigint) AS to_at
FROM incoming CROSS JOIN LATERAL jsonb_array_elements(record -> 'detail' -> 'moves') WITH ORDINALITY AS moves (one, place)
WHERE kind = 'event' AND record ->> 'kind' = 'clock_redated' AND jsonb_typeof(record -> 'detail' -> 'moves') = 'array';
INSERT INTO clock_moves SELECT * FROM told ON CONFLICT DO NOTHING;
CREATE TEMP TABLE moving ON COMMIT DROP AS
SELECT DISTINCT items.box_id, items.at, items.epoch, items.sequence, items.kind, items.record, wanted.total - items.redated_ns AS by_ns, wanted.total,
       fleet_time(items.at_ns + CASE WHEN stays THEN 0 ELSE wanted.total - items.redated_ns END) AS new_at, stays
FROM told
JOIN items ON items.box_id = told.box_id AND items.epoch = told.epoch AND items.sequence >= told.from_sequence AND items.sequence < told.to_sequence
  AND items.at >= coalesce(told.from_at - interval '1 day', '-infinity') AND items.at <= coalesce(told.to_at + interval '1 day', 'infinity')
CROSS JOIN LATERAL (
  SELECT sum(by_ns)::bigint AS total FROM clock_moves
  WHERE clock_moves.box_id = items.box_id AND clock_moves.epoch = items.epoch AND items.sequence >= from_sequence AND items.sequence < to_sequence
) AS wanted
-- Means of a wrong time are of other minutes, and the box tells those anew. A gap before the first sample of a run begins with the run before.
CROSS JOIN LATERAL (
  SELECT items.kind IN ('minute', 'hour', 'day') OR (items.kind = 'gap' AND items.record ->> 'reason' = 'not_running') AS stays
) AS place
-- The times of a fact are those of whoever told it.
WHERE wanted.total <> items.redated_ns AND items.kind <> 'fact';
