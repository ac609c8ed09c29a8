//! Reads a compiled script before it ever runs: what it looks at, and every name in it that does not exist.
//!
//! A misspelt function in a branch that is taken once a month is found here, not in that night.

use super::problem::Problem;
use super::vocabulary::{Word, find, words};
use adapters::channel::nearest;
use rhai::{AST, ASTNode, Expr, FnCallExpr, Position, Stmt};

/// What is known of a script before it runs.
#[derive(Debug, Default)]
pub(super) struct Findings {
    /// The words it looks at.
    pub(super) reads: Vec<&'static Word>,
    /// Everything that is wrong.
    pub(super) problems: Vec<Problem>,
}

/// Walks an AST that was compiled without optimization. `callable` is sorted.
pub(super) fn examine(file: &str, ast: &AST, callable: &[(String, usize)]) -> Findings {
    let own = ast.iter_functions().map(|it| (it.name.to_owned(), it.params.len()));
    let mut walk = Walk { file, callable, own: own.collect(), found: Findings::default() };
    let mut body = ast.clone();
    body.clear_functions();
    body.walk(&mut |path| walk.node(path, false));
    ast.clone_functions_only().walk(&mut |path| walk.node(path, true));
    walk.found.problems.sort_by_key(|problem| (problem.line, problem.column));
    walk.found.problems.dedup();
    walk.found
}

struct Walk<'a> {
    file: &'a str,
    callable: &'a [(String, usize)],
    own: Vec<(String, usize)>,
    found: Findings,
}

impl Walk<'_> {
    fn node(&mut self, path: &[ASTNode<'_>], in_function: bool) -> bool {
        match path.last() {
            Some(ASTNode::Expr(Expr::FnCall(call, at)) | ASTNode::Stmt(Stmt::FnCall(call, at))) => {
                self.call(call, call.args.len(), *at);
            }
            Some(ASTNode::Expr(Expr::MethodCall(call, at))) => self.call(call, call.args.len() + 1, *at),
            Some(ASTNode::Expr(Expr::Variable(name, short, at))) if name.0.is_none() && short.is_none() => {
                self.global(&name.1, *at, in_function);
            }
            Some(ASTNode::Stmt(Stmt::Assignment(assignment))) => self.assigned(&assignment.1.lhs),
            _ => {}
        }
        true
    }

    fn problem(&mut self, at: Position, what: String, next: impl Into<String>) {
        self.found.problems.push(Problem::new(self.file, at, what, next));
    }

    fn call(&mut self, call: &FnCallExpr, arguments: usize, at: Position) {
        let name = call.name.as_str();
        let known = |(known, count): &(String, usize)| known == name && *count == arguments;
        if call.op_token.is_some() || self.callable.iter().chain(&self.own).any(known) {
            return;
        }
        let counts: Vec<String> =
            self.callable.iter().chain(&self.own).filter(|it| it.0 == name).map(|it| it.1.to_string()).collect();
        if !counts.is_empty() {
            let what = format!("`{name}` takes {} arguments, not {arguments}", counts.join(" or "));
            return self.problem(at, what, usage(name));
        }
        if name == "sleep" {
            let next = "it runs at every tick; held_s(name, condition) tells how long something has lasted";
            return self.problem(at, "a script may not sleep".to_owned(), next);
        }
        let names = self.callable.iter().chain(&self.own).map(|it| it.0.as_str());
        let names = names.filter(|name| name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'));
        let next = suggestion(nearest(name, names));
        self.problem(at, format!("there is no function `{name}`"), next);
    }

    fn global(&mut self, name: &str, at: Position, in_function: bool) {
        if self.own.iter().any(|(own, _)| own == name) {
            return;
        }
        match find(name) {
            Some(_) if in_function => self.problem(
                at,
                format!("`{name}` is not visible inside a function"),
                format!("hand it over: fn f({name}) {{ ... }} and call f({name})"),
            ),
            Some(word) => self.reads(word),
            None => {
                let near = nearest(name, words().iter().map(|word| word.name)).filter(|_| !in_function);
                let inside = "a function sees its own arguments and variables only; hand over what it needs";
                let next = if in_function { inside.to_owned() } else { suggestion(near) };
                self.problem(at, format!("there is no variable `{name}`"), next);
            }
        }
    }

    fn reads(&mut self, word: &'static Word) {
        if !self.found.reads.iter().any(|known| known.name == word.name) {
            self.found.reads.push(word);
        }
    }

    fn assigned(&mut self, left: &Expr) {
        let Expr::Variable(name, short, at) = left else { return };
        let global = name.0.is_none() && short.is_none();
        if let Some(word) = find(&name.1).filter(|word| global && !word.writable()) {
            let next = format!("use a name of your own: let my_{0} = {0};", word.name);
            self.problem(*at, format!("`{}` is measured and cannot be set", word.name), next);
        }
    }
}

fn suggestion(near: Option<&str>) -> String {
    match near {
        Some(near) => format!("did you mean `{near}`?"),
        None => "`cnc-gateway check --vocabulary` lists what there is; `let x = ...` makes a variable".to_owned(),
    }
}

fn usage(name: &str) -> String {
    let own = super::vocabulary::FUNCTIONS.iter().find(|it| it.signature.split('(').next() == Some(name));
    let method = || super::functions::methods().find(|it| it.name == name).map(|it| it.signature());
    let signature = own.map(|it| it.signature.to_owned()).or_else(method);
    signature.map(|signature| format!("write {signature}")).unwrap_or_default()
}
