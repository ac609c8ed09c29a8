//! Runs of a compiled script, with what the interpreter may keep between two of them.

use super::collect::ScriptResult;
use rhai::{AST, Caches, Engine, GlobalRuntimeState, Scope, Stmt};

/// What the interpreter keeps for one script: its functions, and which function each call means. Looking every call up
/// anew costs more than half of a run.
pub(super) struct RunningScript {
    cache: Option<(GlobalRuntimeState, Caches)>,
}

impl RunningScript {
    pub(super) fn new() -> Self {
        Self { cache: None }
    }

    /// Runs statements with the functions of another AST.
    pub(super) fn run_within(
        &mut self,
        engine: &Engine,
        scope: &mut Scope<'_>,
        ast: &AST,
        functions: &AST,
    ) -> ScriptResult<()> {
        self.begin_run(engine, functions);
        self.run_statements(engine, scope, functions, ast.statements())
    }

    /// Operations are counted from here on. `ast` holds the functions of the script.
    pub(super) fn begin_run(&mut self, engine: &Engine, ast: &AST) {
        let (global, _) = self.cache.get_or_insert_with(|| create_runtime(engine, ast));
        global.num_operations = 0;
    }

    /// Runs statements from top to bottom. After an error nothing is kept.
    pub(super) fn run_statements(
        &mut self,
        engine: &Engine,
        scope: &mut Scope<'_>,
        functions: &AST,
        statements: &[Stmt],
    ) -> ScriptResult<()> {
        let (mut global, mut caches) = self.cache.take().unwrap_or_else(|| create_runtime(engine, functions));
        #[expect(
            deprecated,
            reason = "the only call that takes caches; rhai offers no other before its next major version"
        )]
        let _value = engine.eval_statements_raw(&mut global, &mut caches, scope, statements)?;
        self.cache = Some((global, caches));
        Ok(())
    }
}

fn create_runtime(engine: &Engine, ast: &AST) -> (GlobalRuntimeState, Caches) {
    let mut global = engine.new_global_runtime_state();
    global.lib.push(ast.shared_lib().clone());
    let mut caches = Caches::new();
    caches.push_fn_resolution_cache();
    (global, caches)
}
