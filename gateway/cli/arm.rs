//! `cnc-gateway arm`, `disarm`, `acknowledge`: orders of a person at the box to the gateway that runs there.

use super::gateway_options::GatewayOptions;
use super::{CommandOutcome, CommandResult, print, print_json};
use crate::control::{self, Order};
use clap::Args;

/// Which gateway, and who orders.
#[derive(Debug, Args)]
pub(super) struct OrderOptions {
    /// Who answers for it; stands in the audit.
    #[arg(long, value_name = "NAME")]
    by: String,
    #[command(flatten)]
    at: GatewayOptions,
}

/// Arguments of `arm`.
#[derive(Debug, Args)]
pub(super) struct ArmArguments {
    /// For how long: 90s, 30m, 8h; as long as the configuration allows when left out.
    #[arg(long = "for", value_name = "TIME", value_parser = seconds)]
    seconds: Option<f64>,
    #[command(flatten)]
    to: OrderOptions,
}

/// Arguments of `disarm` and `acknowledge`.
#[derive(Debug, Args)]
pub(super) struct OrderArguments {
    #[command(flatten)]
    to: OrderOptions,
}

/// `90s`, `30m`, `8h`, or seconds.
fn seconds(text: &str) -> Result<f64, String> {
    let (number, unit_s) = match text.char_indices().last() {
        Some((at, 's')) => (&text[..at], 1.0),
        Some((at, 'm')) => (&text[..at], 60.0),
        Some((at, 'h')) => (&text[..at], 3600.0),
        _ => (text, 1.0),
    };
    let seconds = number.parse::<f64>().ok().map(|number| number * unit_s);
    seconds
        .filter(|seconds| *seconds >= 1.0 && *seconds <= 86_400.0)
        .ok_or("give 90s, 30m or 8h, at most a day".to_owned())
}

/// Lets the gate write.
pub(super) fn arm(arguments: ArmArguments) -> CommandResult {
    let ArmArguments { seconds, to } = arguments;
    send(&to, &Order::Arm { by: to.by.clone(), for_s: seconds })
}

/// Gives the machine back.
pub(super) fn disarm(OrderArguments { to }: OrderArguments) -> CommandResult {
    send(&to, &Order::Disarm { by: to.by.clone() })
}

/// Lets the next feed hold or stop pass.
pub(super) fn acknowledge(OrderArguments { to }: OrderArguments) -> CommandResult {
    send(&to, &Order::Acknowledge { by: to.by.clone() })
}

fn send(to: &OrderOptions, order: &Order) -> CommandResult {
    let reply = control::order(&to.at.data_dir()?, order)?;
    match to.at.json {
        true => print_json(&serde_json::json!({ "schema": "order/1", "done": reply.done, "text": reply.text })),
        false => print(&format!("{}\n", reply.text)),
    }
    Ok(if reply.done { CommandOutcome::Fine } else { CommandOutcome::No })
}

#[cfg(test)]
mod tests {
    use super::seconds;

    #[test]
    fn times_are_said_as_people_say_them() {
        assert_eq!(
            (seconds("90s"), seconds("30m"), seconds("8h"), seconds("45")),
            (Ok(90.0), Ok(1800.0), Ok(28_800.0), Ok(45.0))
        );
        for wrong in ["", "m", "-5m", "0s", "25h", "NaNh", "30 min", "5分"] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
    }
}
