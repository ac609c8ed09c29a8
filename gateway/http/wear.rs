//! `GET /api/v1/wear`: the library of wear models, each with what it is for and how well it fits.

use super::ServerState;
use super::history::{Answer, HistoryQuery, describe_history_error, read_history};
use super::query::QueryKeys;
use super::route::Route;
use axum::extract::{Query as Pairs, State};
use axum::routing::get;
use gateway_history::StoredWearModel;
use rules::estimators::wear::WearModel;
use rules::estimators::wear::WearRecord;
use serde_json::{Value, json};

pub(super) const ROUTES: &[Route] = &[Route::read("/api/v1/wear", || get(serve_wear_models))];

/// `GET /api/v1/wear`: the wear models of the library, newest first.
async fn serve_wear_models(State(shared): State<ServerState>, Pairs(pairs): HistoryQuery) -> Answer {
    QueryKeys::from_pairs(pairs, &[])?;
    read_history(shared, |reader, _| {
        let models = reader.wear_models().map_err(|error| describe_history_error(&error))?;
        let rows: Vec<Value> = models.iter().rev().map(wear_model_to_json).collect();
        Ok(json!({ "schema": "wear-models/1", "models": rows }))
    })
    .await
}

fn wear_model_to_json(stored: &StoredWearModel<WearRecord>) -> Value {
    let record = &stored.record;
    let (formula, residual_sd_w) = match &record.model {
        WearModel::Surface(surface) => (surface.format_formula(), surface.residual_sd_w),
        WearModel::Physical(it) => ("P = P0 (vc/vc0)^x (f/f0)^y (ap/ap0)^z + W VB vc ap".to_owned(), it.residual_sd_w),
    };
    json!({
        "id": stored.id, "at_ms": stored.at_ns.div_euclid(1_000_000), "in_force": stored.in_force,
        "machine": record.key.machine, "tool": record.key.tool, "work_material": record.key.work_material,
        "operation": record.key.operation, "form": record.model.form(), "formula": formula,
        "criterion_mm": record.criterion_mm, "cuts": record.cuts, "r2": record.r2, "residual_sd_w": residual_sd_w,
        "origin": record.origin,
    })
}
