//! `cnc-gateway arm`, `disarm`, `acknowledge`: orders of a person at the box to the gateway that runs there.

use super::gateway_options::GatewayOptions;
use super::{CommandOutcome, CommandResult, print_json, print_text};
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

#[derive(Debug, Args)]
pub(super) struct ArmArguments {
    /// For how long: 90s, 30m, 8h; as long as the configuration allows when left out.
    #[arg(long = "for", value_name = "TIME", value_parser = parse_duration_s)]
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
fn parse_duration_s(text: &str) -> Result<f64, String> {
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
pub(super) fn arm_gate(arguments: ArmArguments) -> CommandResult {
    let ArmArguments { seconds, to } = arguments;
    send_order_and_print(&to, &Order::Arm { by: to.by.clone(), for_s: seconds })
}

/// Gives the machine back.
pub(super) fn disarm_gate(OrderArguments { to }: OrderArguments) -> CommandResult {
    send_order_and_print(&to, &Order::Disarm { by: to.by.clone() })
}

/// Lets the next feed hold or stop pass.
pub(super) fn acknowledge_request(OrderArguments { to }: OrderArguments) -> CommandResult {
    send_order_and_print(&to, &Order::Acknowledge { by: to.by.clone() })
}

fn send_order_and_print(to: &OrderOptions, order: &Order) -> CommandResult {
    let reply = control::send_order(&to.at.data_dir()?, order)?;
    match to.at.json {
        true => print_json(&serde_json::json!({ "schema": "order/1", "done": reply.done, "text": reply.text })),
        false => print_text(&format!("{}\n", reply.text)),
    }
    Ok(if reply.done { CommandOutcome::Fine } else { CommandOutcome::No })
}

#[cfg(test)]
mod tests {
    use super::parse_duration_s;

    #[test]
    fn times_are_said_as_people_say_them() {
        assert_eq!(
            (parse_duration_s("90s"), parse_duration_s("30m"), parse_duration_s("8h"), parse_duration_s("45")),
            (Ok(90.0), Ok(1800.0), Ok(28_800.0), Ok(45.0))
        );
        for wrong in ["", "m", "-5m", "0s", "25h", "NaNh", "30 min", "5分"] {
            assert!(parse_duration_s(wrong).is_err(), "{wrong}");
        }
    }
}
