-- The rows of version 1 into the tables of version 2.
CREATE OR REPLACE FUNCTION pg_temp.json_of(words text) RETURNS jsonb LANGUAGE plpgsql IMMUTABLE AS $$
BEGIN RETURN nullif(words, '')::jsonb; EXCEPTION WHEN others THEN RETURN to_jsonb(words); END $$;
-- Boxes with the same six digits are one: the machine was renamed. Its newest name is the one under which it goes on.
INSERT INTO boxes (box, machine, named_at, first_seen)
SELECT DISTINCT ON (right(box, 6)) box, machine, first_seen, min(first_seen) OVER (PARTITION BY right(box, 6)) FROM boxes_1 ORDER BY right(box, 6), first_seen DESC;
INSERT INTO box_names SELECT boxes.box_id, old.first_seen, old.machine FROM boxes_1 AS old JOIN boxes ON right(boxes.box, 6) = right(old.box, 6) ON CONFLICT DO NOTHING;
INSERT INTO series (name, unit) SELECT name, unit FROM series_1
UNION SELECT DISTINCT jsonb_object_keys(texts), '' FROM items_1 WHERE texts IS NOT NULL
UNION SELECT name, '' FROM (SELECT DISTINCT jsonb_object_keys(missing) AS name FROM items_1 WHERE missing IS NOT NULL) AS silent
      WHERE NOT EXISTS (SELECT FROM series_1 WHERE series_1.name = silent.name);
INSERT INTO items (sequence, at, at_ns, arrived, box_id, historical, kind, series, numbers, texts, reasons, record)
SELECT old.sequence, old.at, (extract(epoch FROM old.at) * 1000000)::bigint * 1000, old.at, boxes.box_id, old.historical, old.kind,
       CASE old.kind WHEN 'sample' THEN
         ARRAY(SELECT series.series_id FROM unnest(old.series) WITH ORDINALITY AS each (id, place)
               JOIN series_1 ON series_1.series_id = each.id JOIN series USING (name, unit) ORDER BY place)
         || ARRAY(SELECT series.series_id FROM jsonb_each_text(coalesce(old.texts, '{}')) AS each JOIN series ON series.name = each.key AND series.unit = '' ORDER BY each.key)
         || ARRAY(SELECT min(series.series_id) FROM jsonb_each_text(coalesce(old.missing, '{}')) AS each JOIN series ON series.name = each.key GROUP BY each.key ORDER BY each.key)
       END,
       CASE old.kind WHEN 'sample' THEN old.numbers END,
       CASE old.kind WHEN 'sample' THEN ARRAY(SELECT value FROM jsonb_each_text(coalesce(old.texts, '{}')) ORDER BY key) END,
       CASE old.kind WHEN 'sample' THEN ARRAY(SELECT value FROM jsonb_each_text(coalesce(old.missing, '{}')) ORDER BY key) END,
       CASE WHEN old.record ? 'detail' THEN old.record || jsonb_build_object('detail', pg_temp.json_of(old.record ->> 'detail'))
            WHEN old.record ? 'json' THEN old.record || jsonb_build_object('json', pg_temp.json_of(old.record ->> 'json'))
            ELSE old.record END
FROM items_1 AS old
JOIN boxes_1 ON boxes_1.box_id = old.box_id
JOIN boxes ON right(boxes.box, 6) = right(boxes_1.box, 6)
ON CONFLICT DO NOTHING;
INSERT INTO incoming (box_id, sequence, at, kind, record) SELECT box_id, sequence, at, kind, record FROM items WHERE record IS NOT NULL;
INSERT INTO box_latest SELECT box_id, max(at), max(arrived), max(sequence), '{}' FROM items GROUP BY box_id;
INSERT INTO refused (received, stream_sequence, subject, reason, payload) SELECT received, -row_number() OVER (), subject, reason, payload FROM refused_1;
DROP TABLE items_1, boxes_1, series_1, refused_1;
