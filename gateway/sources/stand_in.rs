//! Who may take whose place: what the configuration declares, and the ways of reading one device among themselves.

use adapters::ChannelId;
use adapters::merge::SourcePlan;
use gateway_config::SourceConfig;

/// Writes into each plan what it may stand in for. `owners` names the configured source of each plan.
///
/// # Errors
/// Channels that are declared and that the source, or every one before it, does not deliver; in words.
pub(crate) fn declare_stand_ins(
    plans: &mut [SourcePlan],
    owners: &[&str],
    sources: &[SourceConfig],
) -> Result<(), Vec<String>> {
    let mut problems = Vec::new();
    for source in sources {
        for channel in &source.stand_in {
            problems.extend(find_declaration_problem(*channel, &source.name, plans, owners));
        }
    }
    if !problems.is_empty() {
        return Err(problems);
    }
    for at in 0..plans.len() {
        let Some(owner) = owners.get(at) else { continue };
        let declared = sources.iter().filter(|source| source.name == *owner).flat_map(|source| &source.stand_in);
        // What one device says in two ways is of one machine: samples first, and what is polled while there are none.
        let same_device = owners[..at].iter().zip(plans.iter()).filter(|(name, _)| *name == owner);
        let mut stand_in: Vec<ChannelId> =
            declared.chain(same_device.flat_map(|(_, plan)| &plan.channels)).copied().collect();
        stand_in.retain(|channel| plans[at].channels.contains(channel));
        plans[at].stand_in = stand_in;
    }
    Ok(())
}

fn find_declaration_problem(channel: ChannelId, name: &str, plans: &[SourcePlan], owners: &[&str]) -> Option<String> {
    let delivers = |at: &usize| plans[*at].channels.contains(&channel);
    let of = |wanted: &str| (0..plans.len()).filter(|at| owners.get(*at) == Some(&wanted)).collect::<Vec<_>>();
    let own = of(name);
    if !own.iter().any(delivers) {
        return Some(format!(
            "{name:?} is to stand in for {}, which it does not deliver: take it out of `stand_in`",
            channel.name()
        ));
    }
    let first = own.first().copied().unwrap_or_default();
    if !(0..first).any(|at| delivers(&at)) {
        return Some(format!(
            "{name:?} is to stand in for {}, which no source before it delivers: put it behind the one whose place it takes, or take it out of \
             `stand_in`",
            channel.name()
        ));
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    fn channel(name: &str) -> ChannelId {
        ChannelId::from_name(name).expect("in the table")
    }

    fn plan(channels: &[&str]) -> SourcePlan {
        SourcePlan {
            name: "address".to_owned(),
            channels: channels.iter().map(|name| channel(name)).collect(),
            period: Duration::from_millis(100),
            stand_in: Vec::new(),
        }
    }

    fn source(name: &str, stand_in: &[&str]) -> SourceConfig {
        SourceConfig {
            address: "simulated://lathe".parse().expect("an address"),
            name: name.to_owned(),
            period: None,
            deadline: Duration::from_secs(3),
            stand_in: stand_in.iter().map(|name| channel(name)).collect(),
        }
    }

    #[test]
    fn only_what_is_declared_stands_in_and_one_device_for_itself() {
        let mut plans = [
            plan(&["spindle_current_a"]),
            plan(&["spindle_current_a", "total_power_w"]),
            plan(&["total_power_w", "spindle_current_a", "supply_voltage_v"]),
        ];
        let sources = [source("control", &[]), source("meter", &["total_power_w"])];
        declare_stand_ins(&mut plans, &["control", "control", "meter"], &sources).expect("possible");
        let names = |plan: &SourcePlan| plan.stand_in.iter().map(|id| id.name()).collect::<Vec<_>>();
        assert_eq!(names(&plans[0]), Vec::<&str>::new());
        assert_eq!(names(&plans[1]), ["spindle_current_a"]);
        assert_eq!(names(&plans[2]), ["total_power_w"]);
    }

    #[test]
    fn a_declaration_that_can_have_no_effect_is_refused() {
        let mut plans = [plan(&["total_power_w"]), plan(&["supply_voltage_v"])];
        let mut told = |wanted: &str| {
            let sources = [source("a", &[]), source("b", &[wanted])];
            declare_stand_ins(&mut plans, &["a", "b"], &sources).expect_err("refused").join("; ")
        };
        assert!(told("total_power_w").contains("which it does not deliver"));
        assert!(told("supply_voltage_v").contains("which no source before it delivers"));
    }
}
