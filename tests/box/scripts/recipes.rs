//! The recipes: their trials with the defaults and at the ends of their settings, and the first one on the simulated machine.

use super::*;
use rules::script::{
    DeclarationPlace, RECIPES, SettingValue, SettingValues, compile_with, find_recipe, list_declarations,
    list_shipped_scripts, prepare_with, run_trials,
};

/// A recipe beside teach, whose channels some of them read.
fn beside_teach(name: &str) -> Vec<ScriptFile> {
    let teach = list_shipped_scripts().into_iter().find(|file| file.name == "teach.rhai").expect("shipped");
    vec![find_recipe(name).expect("a recipe").to_file(), teach]
}

#[test]
fn at_least_twelve_recipes_pass_their_trials_at_every_end_of_their_settings() {
    assert!(RECIPES.len() >= 12);
    let (mut count, mut failed) = (0, Vec::new());
    for recipe in RECIPES {
        let files = beside_teach(recipe.name);
        let set =
            compile_with(&files, &SettingValues::default()).unwrap_or_else(|problems| panic!("{}", told(&problems)));
        let own = run_trials(&set).iter().filter(|it| *it.file == files[0].name && it.met > 0).count();
        assert!(own > 0, "{} has a trial", recipe.name);
        count += own;
        let text = recipe.format_page();
        let chinese = |c: char| ('\u{4e00}'..='\u{9fff}').contains(&c);
        assert!(recipe.title().contains(chinese) && text.contains("```rhai"), "{text}");
        let mut wanted = vec![SettingValues::default()];
        for setting in list_declarations(&files[..1]).expect("readable") {
            for number in setting.range.into_iter().flat_map(|(least, greatest)| [least, greatest]) {
                let mut values = SettingValues::default();
                values.set_value(
                    setting.section(),
                    &setting.name,
                    &DeclarationPlace::Machine,
                    Some(SettingValue::Number(number)),
                );
                wanted.push(values);
            }
        }
        for values in wanted {
            if let Err(problems) = prepare_with(&files, &values) {
                failed.push(format!("{}:\n{}{}", recipe.name, values.to_toml_text(), told(&problems)));
            }
        }
    }
    println!("{} recipes, {count} trials", RECIPES.len());
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}
