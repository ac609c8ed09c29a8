// The editor of the rules: CodeMirror with the words of the box. It lives in a shadow root, where its styles are sheets
// of the object model: the policy of the page lets no other styles in.
import * as cm from "/web/codemirror.js";
import { own, scriptWords, t } from "./words.js";

const KEYWORDS = new Set([
  "let",
  "const",
  "if",
  "else",
  "fn",
  "for",
  "in",
  "while",
  "loop",
  "do",
  "until",
  "return",
  "break",
  "continue",
  "switch",
  "true",
  "false",
  "throw",
  "try",
  "catch",
  "private",
  "import",
  "export",
  "as",
  "global",
  "this",
  "is_shared",
  "call",
  "curry",
]);

/** Rhai, as far as colours need it. `words` are the names that the box gives to scripts. */
function rhai(words) {
  return cm.StreamLanguage.define({
    name: "rhai",
    startState: () => ({ block: 0, text: null }),
    token(stream, state) {
      if (state.block > 0) {
        while (!stream.eol()) {
          if (stream.match("*/")) {
            state.block -= 1;
            if (!state.block) break;
          } else if (stream.match("/*")) state.block += 1;
          else stream.next();
        }
        return "comment";
      }
      if (state.text) return inText(stream, state);
      if (stream.eatSpace()) return null;
      if (stream.match("//")) {
        stream.skipToEnd();
        return "comment";
      }
      if (stream.match("/*")) {
        state.block = 1;
        return "comment";
      }
      if (stream.match(/^["'`]/)) {
        state.text = stream.current();
        return inText(stream, state);
      }
      if (stream.match(/^\d[\d_]*(\.\d+)?([eE][+-]?\d+)?/)) return "number";
      if (stream.match(/^[A-Za-z_]\w*/)) return word(stream.current(), words);
      stream.next();
      return "operator";
    },
    languageData: { commentTokens: { line: "//", block: { open: "/*", close: "*/" } } },
  });
}

function inText(stream, state) {
  while (!stream.eol()) {
    const next = stream.next();
    if (next === "\\") stream.next();
    else if (next === state.text) {
      state.text = null;
      break;
    }
  }
  if (stream.eol() && state.text !== "`") state.text = null;
  return "string";
}

function word(text, words) {
  if (KEYWORDS.has(text)) return "keyword";
  if (/^trial_|^on_/.test(text)) return "typeName";
  if (words.functions.has(text)) return "macroName";
  if (words.variables.has(text)) return "propertyName";
  return /^[A-Z][A-Z0-9_]+$/.test(text) ? "atom" : "variableName";
}

const { tags } = cm;
const colours = cm.HighlightStyle.define([
  { tag: tags.comment, color: "var(--faint)", fontStyle: "italic" },
  { tag: tags.string, color: "var(--line-b)" },
  { tag: tags.number, color: "var(--line-c)" },
  { tag: tags.keyword, color: "var(--line-d)", fontWeight: "600" },
  { tag: tags.macroName, color: "var(--accent)" },
  { tag: tags.propertyName, color: "var(--line-e)", fontWeight: "600" },
  { tag: tags.typeName, color: "var(--line-f)", fontWeight: "600" },
  { tag: tags.atom, color: "var(--line-c)" },
]);

const look = cm.EditorView.theme({
  "&": { color: "var(--text)", backgroundColor: "var(--card)", fontSize: "14px", height: "100%" },
  ".cm-scroller": { fontFamily: "ui-monospace, Menlo, Consolas, monospace", lineHeight: "1.5" },
  ".cm-gutters": { backgroundColor: "var(--page)", color: "var(--soft)", border: "0" },
  ".cm-activeLine, .cm-activeLineGutter": { backgroundColor: "color-mix(in srgb, var(--accent) 9%, transparent)" },
  ".cm-cursor": { borderLeftColor: "var(--text)" },
  "&.cm-focused .cm-selectionBackground, .cm-selectionBackground": {
    backgroundColor: "color-mix(in srgb, var(--accent) 28%, transparent) !important",
  },
  ".cm-tooltip": { backgroundColor: "var(--card)", color: "var(--text)", border: "1px solid var(--line)" },
  ".cm-tooltip-autocomplete ul li[aria-selected]": { backgroundColor: "var(--accent)", color: "var(--on-accent)" },
  ".cm-diagnostic": { whiteSpace: "pre-wrap", maxWidth: "40rem" },
});

/** From the document of the box (`rules-api/1`): what may be completed. */
export function vocabulary(api) {
  const bare = (signature) => signature.split("(")[0].trim();
  const option = (label, type, detail, info) => ({ label, type, detail, info });
  return {
    variables: new Set(api.variables.map((v) => v.name)),
    functions: new Set([...api.functions, ...api.methods, ...api.handlers].map((f) => f.name ?? bare(f.signature))),
    options: [
      ...api.variables.map((v) => option(v.name, "variable", v.unit, own(v))),
      ...api.functions.map((f) =>
        option(bare(f.signature), "function", f.signature.slice(bare(f.signature).length), own(f)),
      ),
      ...api.methods.map((m) => option(m.name, "method", m.signature.slice(m.name.length), `${own(m)} → ${m.returns}`)),
      ...api.handlers.map((h) => option(`fn ${h.signature}`, "type", "", own(h))),
      ...api.settings.map((s) => option(s.name, "constant", s.unit, s.en)),
      ...[...KEYWORDS].map((k) => option(k, "keyword")),
    ],
  };
}

export class Editor {
  constructor(host, { words, onChange, label }) {
    const shadow = host.attachShadow({ mode: "open" });
    const box = document.createElement("div");
    box.style.height = "100%";
    shadow.append(box);
    this.readOnly = new cm.Compartment();
    const extensions = [
      cm.lineNumbers(),
      cm.highlightActiveLine(),
      cm.drawSelection(),
      cm.history(),
      cm.bracketMatching(),
      cm.closeBrackets(),
      cm.lintGutter(),
      cm.highlightSelectionMatches(),
      cm.indentUnit.of("    "),
      rhai(words),
      cm.syntaxHighlighting(colours),
      look,
      cm.EditorView.lineWrapping,
      this.readOnly.of(cm.EditorState.readOnly.of(false)),
      cm.autocompletion({ override: [cm.completeFromList(words.options)] }),
      cm.keymap.of([
        ...cm.closeBracketsKeymap,
        ...cm.defaultKeymap,
        ...cm.historyKeymap,
        ...cm.completionKeymap,
        ...cm.searchKeymap,
        ...cm.lintKeymap,
        cm.indentWithTab,
      ]),
      cm.EditorView.contentAttributes.of({ "aria-label": label, tabindex: "0" }),
      cm.EditorView.updateListener.of((update) => {
        if (update.docChanged) onChange?.(update.state.doc.toString());
      }),
    ];
    this.extensions = extensions;
    this.view = new cm.EditorView({ state: cm.EditorState.create({ doc: "", extensions }), parent: box, root: shadow });
  }

  get text() {
    return this.view.state.doc.toString();
  }

  /** Another file: its own past, so that undo does not lead into the file before. */
  open(text, readOnly = false) {
    this.view.setState(cm.EditorState.create({ doc: text, extensions: this.extensions }));
    if (readOnly) this.view.dispatch({ effects: this.readOnly.reconfigure(cm.EditorState.readOnly.of(true)) });
  }

  /** Marks problems at their lines: [{line, column, what, next}]. */
  problems(list) {
    const { doc } = this.view.state;
    const marks = list
      .filter((p) => p.line >= 1 && p.line <= doc.lines)
      .map((p) => {
        const line = doc.line(p.line);
        const from = Math.min(line.to, line.from + Math.max(0, (p.column ?? 1) - 1));
        return {
          from,
          to: Math.max(from, line.to),
          severity: "error",
          message: [p.what, p.next].filter(Boolean).map(scriptWords).join("\n"),
        };
      });
    this.view.dispatch(cm.setDiagnostics(this.view.state, marks));
  }

  goTo(number) {
    const { doc } = this.view.state;
    const line = doc.line(Math.min(Math.max(1, number), doc.lines));
    this.view.dispatch({
      selection: { anchor: line.from },
      effects: cm.EditorView.scrollIntoView(line.from, { y: "center" }),
    });
    this.view.focus();
  }

  insert(text) {
    this.view.dispatch(this.view.state.replaceSelection(text));
    this.view.focus();
  }

  destroy() {
    this.view.destroy();
  }
}

export const editorLabel = () => t("editor");
