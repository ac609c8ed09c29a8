-- Which alarms came most often, the last seven days, and for how long they stood.
SELECT code, source, count(*) AS times, count(DISTINCT box_id) AS machines,
       sum(extract(epoch FROM coalesce(cleared, now()) - raised)) / 60 AS minutes, max(raised) AS last_raised
FROM alarms
WHERE raised >= now() - interval '7 days'
GROUP BY code, source
ORDER BY times DESC, code;
