//! README and handbook as they stand in the tree, and the code in them.

use std::path::{Path, PathBuf};

/// One Markdown file.
pub(crate) struct Document {
    /// Path below the root.
    pub(crate) name: String,
    /// Where it is.
    pub(crate) path: PathBuf,
    /// All of it.
    pub(crate) text: String,
}

/// A code block.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Block {
    /// What stands behind the fence, such as `toml`; empty for an indented block.
    pub(crate) language: String,
    /// Line of the document at which it begins, from 1.
    pub(crate) line: usize,
    /// Its lines.
    pub(crate) lines: Vec<String>,
}

pub(crate) fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// README and every chapter.
pub(crate) fn documents() -> Vec<Document> {
    let folder = root().join("gateway/handbook");
    let entries = std::fs::read_dir(folder).expect("readable").map(|entry| entry.expect("readable").path());
    let mut paths: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|end| end == "md")).collect();
    paths.push(root().join("README.md"));
    paths.sort();
    paths.iter().map(|path| document(path)).collect()
}

fn document(path: &Path) -> Document {
    let name = path.strip_prefix(root()).expect("below the root").display().to_string();
    Document { name, path: path.to_owned(), text: std::fs::read_to_string(path).expect("text") }
}

impl Document {
    /// Every code block, in order.
    pub(crate) fn blocks(&self) -> Vec<Block> {
        let (mut blocks, mut fenced) = (Vec::<Block>::new(), None::<Block>);
        let (mut before_is_code, mut empty) = (false, 1);
        for (index, line) in self.text.lines().enumerate() {
            let inner = line.trim_start();
            if let Some(language) = inner.strip_prefix("```") {
                match fenced.take() {
                    Some(block) => blocks.push(block),
                    None => {
                        let language = language.trim().to_owned();
                        fenced = Some(Block { language, line: index + 2, lines: Vec::new() });
                    }
                }
                before_is_code = false;
            } else if let Some(block) = &mut fenced {
                block.lines.push(line.to_owned());
            } else if line.starts_with("    ") && (before_is_code || empty > 0) {
                let text = line.get(4..).unwrap_or_default().to_owned();
                match blocks.last_mut().filter(|_| before_is_code) {
                    Some(block) => {
                        // An empty line does not end an indented block.
                        block.lines.extend(std::iter::repeat_n(String::new(), empty));
                        block.lines.push(text);
                    }
                    None => blocks.push(Block { language: String::new(), line: index + 1, lines: vec![text] }),
                }
                before_is_code = true;
            } else if !inner.is_empty() {
                before_is_code = false;
            }
            empty = if inner.is_empty() { empty + 1 } else { 0 };
        }
        blocks
    }

    /// Code in running text, each with its line; code blocks are left out.
    pub(crate) fn spans(&self) -> Vec<(usize, String)> {
        let (mut spans, mut in_block) = (Vec::new(), false);
        for (index, line) in self.text.lines().enumerate() {
            if line.trim_start().starts_with("```") {
                in_block = !in_block;
            } else if !in_block && !line.starts_with("    ") {
                spans.extend(line.split('`').skip(1).step_by(2).map(|span| (index + 1, span.to_owned())));
            }
        }
        spans
    }

    /// Targets of links and pictures.
    pub(crate) fn links(&self) -> Vec<String> {
        let target = |part: &str| part.split(')').next().unwrap_or_default().to_owned();
        self.text.split("](").skip(1).map(target).collect()
    }
}

#[test]
fn code_is_found_in_a_document() {
    let text = "# T\n\n    a b\n\n    c\n\ntext `x y` and [l](f.md)\n```toml\nk = 1\n```\n";
    let document = Document { name: String::new(), path: PathBuf::new(), text: text.to_owned() };
    let block = |language: &str, line, lines: &[&str]| Block {
        language: language.to_owned(),
        line,
        lines: lines.iter().map(|line| (*line).to_owned()).collect(),
    };
    assert_eq!(document.blocks(), [block("", 3, &["a b", "", "c"]), block("toml", 9, &["k = 1"])]);
    assert_eq!(document.spans(), [(7, "x y".to_owned())]);
    assert_eq!(document.links(), ["f.md"]);
}
