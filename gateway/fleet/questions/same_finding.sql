-- Which effects did the twin find missing, on which machines, since when, and how often?
SELECT found ->> 'effect' AS effect,
       count(DISTINCT label) AS machines,
       count(*) AS diagnoses,
       min(at) AS first_at,
       max(at) AS last_at,
       string_agg(DISTINCT label, ', ' ORDER BY label) AS which
FROM diagnoses JOIN placements AS place ON place.box_id = diagnoses.box_id AND at >= place.since AND at < place.until
CROSS JOIN LATERAL jsonb_array_elements(CASE jsonb_typeof(diagnosis -> 'missing') WHEN 'array' THEN diagnosis -> 'missing' ELSE '[]' END) AS found
GROUP BY 1
ORDER BY machines DESC, diagnoses DESC, effect;
