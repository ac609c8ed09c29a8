//! Can a running machine feed a model? A diagnosis may place an effect in a run, a lot or a column of its own file: none of them is
//! there while the machine works, and a model that needs one would be compared with nothing from then on.

use super::expectation::drop_parts_of_the_past;
use crate::bind::bind_model;
use crate::model::Model;
use adapter_core::channel::ChannelId;
use physics::Scene;
use recording::Recording;

/// Columns that the comparison adds to the channels by itself.
const ADDED: [&str; 2] = ["engaged", "cutting_time_min"];

/// Columns that only the reading of a stretch makes: how it is cut into pieces.
const OF_READING: [&str; 2] = ["run", "pass"];

/// What a model needs and the machine does not deliver, each with what needs it; `recent` is what the machine has delivered
/// lately, with the output. Empty where everything is there.
#[must_use]
pub fn list_unfed_inputs(model: &Model, recent: &Recording) -> Vec<String> {
    let mut live = Recording::new("live", recent.time_s.clone(), recent.start_ns);
    for column in recent.columns() {
        let is_live = ChannelId::from_name(&column.name).is_some() && !OF_READING.contains(&column.name.as_str());
        if is_live || ADDED.contains(&column.name.as_str()) {
            live.set_column(&column.name, column.cells.clone());
        }
    }
    let mut model = model.clone();
    drop_parts_of_the_past(&mut model);
    match Scene::new(&live, &model.output, &model.roles) {
        Err(error) => vec![error.to_string()],
        Ok(scene) => bind_model(&model, &scene).err().unwrap_or_default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parse_model;
    use recording::read_csv;

    #[test]
    fn an_effect_that_is_placed_in_a_run_cannot_be_fed() {
        let text = "time_s,run,spindle_power_w,spindle_speed_rpm,engaged,depth_of_cut_mm,feed_mm_min,diameter_mm,my_own_w\n\
                    0,1,500,800,1,1,160,60,1\n1,1,510,800,1,1,160,60,2\n2,2,505,900,0,1,160,60,1\n";
        let recent = read_csv(text.as_bytes(), "t.csv").expect("readable").recording;
        let model = |effect: &str| {
            let cut = "[[effect]]\nkind = \"cutting_power\"\nparameters = { kc11_n_per_mm2 = 1800.0, mc = 0.25 }\n";
            parse_model(&format!("schema = \"model/1\"\noutput = \"spindle_power_w\"\n{cut}{effect}")).expect("a model")
        };
        assert_eq!(list_unfed_inputs(&model(""), &recent), Vec::<String>::new());
        let placed = "[[effect]]\nkind = \"hardness_batch\"\nparameters = { gain = -0.3 }\nform = \"step\"\n\
                      place = { column = \"run\", equals = \"2\" }\n";
        let unfed = list_unfed_inputs(&model(placed), &recent);
        assert!(unfed.len() == 1 && unfed[0].contains("hardness_batch"), "{unfed:?}");
        let own = list_unfed_inputs(&model("[[effect]]\nkind = \"linear\"\ncolumns = { my_own_w = 1.0 }\n"), &recent);
        assert!(own.len() == 1 && own[0].contains("my_own_w"), "{own:?}");
    }
}
