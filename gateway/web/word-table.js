// Every text of the page, from the tables by subject: key, English, Chinese. A test holds that both are there and that
// every key that is used stands in one table, and in one only.
import { FRAME } from "/web/words-frame.js";
import { NOW } from "/web/words-now.js";
import { HISTORY } from "/web/words-history.js";
import { WEAR } from "/web/words-wear.js";
import { THERMAL } from "/web/words-thermal.js";
import { TWIN } from "/web/words-twin.js";
import { RULES } from "/web/words-rules.js";
import { AUDIT } from "/web/words-audit.js";
import { SYSTEM } from "/web/words-system.js";

export const WORDS = { ...FRAME, ...NOW, ...HISTORY, ...WEAR, ...THERMAL, ...TWIN, ...RULES, ...AUDIT, ...SYSTEM };
