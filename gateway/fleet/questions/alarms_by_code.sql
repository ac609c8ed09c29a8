-- Which alarms came most often, the last seven days, and for how long they stood.
SELECT code, source, count(*) AS times, count(DISTINCT label) AS machines,
       sum(extract(epoch FROM coalesce(cleared, now()) - raised)) / 60 AS minutes, max(raised) AS last_raised
FROM alarms JOIN placements AS place ON place.box_id = alarms.box_id AND raised >= place.since AND raised < place.until
WHERE raised >= now() - interval '7 days'
GROUP BY code, source
ORDER BY times DESC, code;
