//! Recipes: small scripts for wishes that shops often have, each tested, each a page. They are in no directory until somebody copies
//! them there.

use super::compile::ScriptFile;

/// A recipe: a script whose head says in both languages what it does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ScriptRecipe {
    /// What `cnc-gateway help` calls it; the name of the script without its ending.
    pub name: &'static str,
    /// The script as it can be saved, its head included.
    pub text: &'static str,
}

macro_rules! recipes {
    ($($name:literal),* $(,)?) => {
        /// Every recipe that the program brings along.
        pub static RECIPES: &[ScriptRecipe] =
            &[$(ScriptRecipe { name: $name, text: include_str!(concat!("../recipes/", $name, ".rhai")) }),*];
    };
}

recipes! {
    "above_learned",
    "tool_time",
    "broken_edge",
    "first_part",
    "gentle_entry",
    "empty_part",
    "part_energy_limit",
    "idle_energy",
    "warm_up",
    "bearing_rise",
    "peak_power",
    "alarm_count",
    "supply_guard",
}

impl ScriptRecipe {
    /// The first line of the head: English and Chinese.
    #[must_use]
    pub fn title(&self) -> &'static str {
        self.text.lines().next().map_or(self.name, |line| line.trim_start_matches('/').trim())
    }

    /// The page: title, how to put it in charge, the script.
    #[must_use]
    pub fn format_page(&self) -> String {
        let Self { name, text } = self;
        format!(
            "# {title}\n\nCopy it into the directory of the scripts, choose its numbers in `settings.toml` under `[{name}]`, and try it with \
             `cnc-gateway rules test`.\n复制到脚本目录，在 `settings.toml` 的 `[{name}]` 中设定数值，用 `cnc-gateway rules test` 试验。\n\n\
             ```sh\ncnc-gateway help {name} --script > cnc-gateway-data/scripts/{name}.rhai\n```\n\n```rhai\n{text}```\n",
            title = self.title(),
        )
    }

    /// The script as a file.
    #[must_use]
    pub fn to_file(&self) -> ScriptFile {
        ScriptFile { name: format!("{}.rhai", self.name), text: self.text.to_owned() }
    }
}

/// The recipe of this name.
#[must_use]
pub fn find_recipe(name: &str) -> Option<&'static ScriptRecipe> {
    RECIPES.iter().find(|recipe| recipe.name == name.trim_end_matches(".rhai"))
}
