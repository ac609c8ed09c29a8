-- Which effects did the twin find missing, on which machines, since when, and how often?
SELECT found ->> 'effect' AS effect,
       count(DISTINCT machine) AS machines,
       count(*) AS diagnoses,
       min(at) AS first_at,
       max(at) AS last_at,
       string_agg(DISTINCT machine, ', ' ORDER BY machine) AS which
FROM diagnoses
CROSS JOIN LATERAL jsonb_array_elements(CASE jsonb_typeof(diagnosis -> 'missing') WHEN 'array' THEN diagnosis -> 'missing' ELSE '[]' END) AS found
GROUP BY 1
ORDER BY machines DESC, diagnoses DESC, effect;
