-- From version 1, which had no number: items with JSON in the place of lists, and a box for every name of a machine. What the new
-- tables need is created between the two parts.
DROP VIEW IF EXISTS readings, diagnoses;
ALTER TABLE items RENAME TO items_1;
DO $$
DECLARE old record;
BEGIN
  FOR old IN SELECT inhrelid::regclass::text AS name FROM pg_inherits WHERE inhparent = 'items_1'::regclass LOOP
    EXECUTE format('ALTER TABLE %s RENAME TO %s', old.name, 'old_' || old.name);
  END LOOP;
  FOR old IN SELECT indexrelid::regclass::text AS name FROM pg_index WHERE indrelid = 'items_1'::regclass LOOP
    EXECUTE format('ALTER INDEX %s RENAME TO %s', old.name, 'old_' || old.name);
  END LOOP;
END $$;
ALTER TABLE items_1 DROP CONSTRAINT IF EXISTS items_box_id_fkey;
ALTER TABLE boxes RENAME TO boxes_1;
ALTER INDEX boxes_pkey RENAME TO old_boxes_pkey;
ALTER INDEX boxes_box_key RENAME TO old_boxes_box_key;
ALTER TABLE series RENAME TO series_1;
ALTER INDEX series_pkey RENAME TO old_series_pkey;
ALTER INDEX series_name_unit_key RENAME TO old_series_name_unit_key;
ALTER TABLE refused RENAME TO refused_1;
